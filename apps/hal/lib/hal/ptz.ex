defmodule Hal.Ptz do
  @moduledoc """
  What a pan-tilt-zoom unit can do. Radians: pan positive to the left, tilt positive upwards;
  `field_of_view` is the horizontal one at the present zoom.

  Run by `Hal.Device`, like `Hal.Drive`.
  """

  @type reading :: {:ptz, %{pan: float(), tilt: float(), field_of_view: float()}}

  @doc "Opens the line."
  @callback init(keyword()) :: {:ok, state :: term()} | {:error, reason :: term()}

  @doc "Looks there, as fast as the unit can."
  @callback look(pan :: float(), tilt :: float(), state :: term()) ::
              {:ok, term()} | {:error, term(), term()}

  @doc "Turns one raw message from the line into readings; unknown messages give `[]`."
  @callback handle_message(term(), state :: term()) ::
              {:ok, [reading()], term()} | {:error, term(), term()}

  @doc "Closes the line."
  @callback terminate(state :: term()) :: :ok
end
