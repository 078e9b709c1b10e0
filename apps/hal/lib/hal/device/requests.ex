defmodule Hal.Device.Requests do
  @moduledoc false
  # Gives a driver the requests other than speeds: the direction and zoom of a pan-tilt unit, and a
  # camera's next picture. The last direction and zoom are kept, and repeated to a reopened driver.
  alias Hal.Device.{Lifecycle, Obedience, State}

  @doc "Keeps a request, and passes it to the driver if that is open and has this callback."
  @spec keep(State.t(), callback :: atom(), arguments :: list()) :: State.t()
  def keep(s, callback, arguments),
    do: carry_out(%{s | requests: Map.put(s.requests, callback, arguments)}, callback)

  @doc "Repeats the kept requests to a driver that has just been opened."
  @spec remind(State.t()) :: State.t()
  def remind(s), do: s.requests |> Map.keys() |> Enum.reduce(s, &carry_out(&2, &1))

  @doc "Asks a camera for its next picture; called once the last one has been passed on."
  @spec ask(State.t()) :: State.t()
  def ask(%{kind: :camera, inner: {:open, inner}} = s),
    do: Lifecycle.done(s, s.driver.next(inner))

  def ask(s), do: s

  defp carry_out(%{inner: {:open, inner}} = s, callback) do
    arguments = s.requests[callback] ++ [inner]

    if function_exported?(s.driver, callback, length(arguments)),
      do: s |> told(callback) |> Lifecycle.done(apply(s.driver, callback, arguments)),
      else: s
  end

  defp carry_out(s, _callback), do: s

  defp told(%{requests: %{look: [pan, tilt]}} = s, :look),
    do: %{s | obedience: Obedience.told(s.obedience, {pan, tilt})}

  defp told(s, _callback), do: s
end
