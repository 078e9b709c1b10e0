defmodule Lab.Check.Crash do
  @moduledoc false
  # Judges `crash`: no step of a run in lockstep raises. Pure.
  @behaviour Lab.Check.Kind
  alias Lab.Check.Violation

  @impl Lab.Check.Kind
  def new(_options), do: nil

  @impl Lab.Check.Kind
  def note(_asked, %{crash: {at_ms, reason}}, _none),
    do: {:never, [Violation.crash(at_ms, reason)], nil}

  def note(_asked, %{stops: nil}, _none), do: :unseen
  def note(_asked, _moment, _none), do: {:never, [], nil}
end
