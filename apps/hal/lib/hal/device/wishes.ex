defmodule Hal.Device.Wishes do
  @moduledoc """
  Requests to a device other than speeds: where a pan-tilt unit should look, and a camera's next
  picture. The last requests are kept, and repeated to a reopened driver.
  """
  alias Hal.Device.{Lifecycle, State}

  @doc "Takes a wish, and says it if somebody is there who knows it."
  @spec wish(State.t(), callback :: atom(), arguments :: list()) :: State.t()
  def wish(s, callback, arguments),
    do: carry_out(%{s | wishes: Map.put(s.wishes, callback, arguments)}, callback)

  @doc "Where a pan-tilt unit was to look before it failed, or while nobody was there."
  @spec remind(State.t()) :: State.t()
  def remind(s), do: s.wishes |> Map.keys() |> Enum.reduce(s, &carry_out(&2, &1))

  @doc "A camera gives its next picture only once the last one was handed on."
  @spec ask(State.t()) :: State.t()
  def ask(%{kind: :camera, inner: {:open, inner}} = s),
    do: Lifecycle.done(s, s.driver.next(inner))

  def ask(s), do: s

  defp carry_out(%{inner: {:open, inner}} = s, callback) do
    arguments = s.wishes[callback] ++ [inner]

    if function_exported?(s.driver, callback, length(arguments)),
      do: Lifecycle.done(s, apply(s.driver, callback, arguments)),
      else: s
  end

  defp carry_out(s, _callback), do: s
end
