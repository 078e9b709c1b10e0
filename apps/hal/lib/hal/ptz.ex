defmodule Hal.Ptz do
  @moduledoc """
  Defines what a pan-tilt-zoom unit can do. Radians: pan positive to the left, tilt positive upwards;
  `field_of_view` is the horizontal one at the present zoom.

  Run by `Hal.Device`, like `Hal.Drive`.
  """

  @typedoc """
  The direction of view. `age_ms` is how old it was when the reading was passed on, if the driver
  knows. What the unit refuses is `{:refused, :look, line}` (or `:zoom`), with the reason in one
  line; what it has done, `{:obeyed, :look}`: `Hal.Device.Obedience` counts these, and tells them. `{:odd, line}` is told once.
  """
  @type reading ::
          {:ptz,
           %{
             required(:pan) => float(),
             required(:tilt) => float(),
             required(:field_of_view) => float(),
             optional(:age_ms) => non_neg_integer()
           }}
          | {:refused, request :: atom(), line :: String.t()}
          | {:obeyed, request :: atom()}
          | {:odd, line :: String.t()}

  @doc "Opens the line."
  @callback init(keyword()) :: {:ok, state :: term()} | {:error, reason :: term()}

  @doc "Turns to this direction, as fast as the unit can."
  @callback look(pan :: float(), tilt :: float(), state :: term()) ::
              {:ok, term()} | {:error, term(), term()}

  @doc "Zooms to a horizontal field of view (radians), or as near to it as the unit can."
  @callback zoom(field_of_view :: float(), state :: term()) ::
              {:ok, term()} | {:error, term(), term()}

  @doc """
  How far the unit can turn, `{{least pan, greatest pan}, {least tilt, greatest tilt}}` in radians;
  `nil` if that is not known. A unit that stands still away from a direction within its reach is
  not online (`Hal.Device.Obedience`).
  """
  @callback reach(state :: term()) :: Hal.Device.Obedience.reach()

  @doc "Turns one raw message from the line into readings; unknown messages give `[]`."
  @callback handle_message(term(), state :: term()) ::
              {:ok, [reading()], term()} | {:error, term(), term()}

  @doc "Describes an error of this driver, opened with these options, in one line for people."
  @callback explain(reason :: term(), options :: keyword()) :: String.t()

  @doc "Closes the line."
  @callback terminate(state :: term()) :: :ok

  @doc "The options that the driver takes; `mix robot.check` checks robot files against them."
  @callback option_table() :: Hal.Options.table()

  @optional_callbacks explain: 2, zoom: 2, reach: 1, option_table: 0
end
