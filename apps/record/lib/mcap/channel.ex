defmodule Mcap.Channel do
  @moduledoc """
  Describes a stream of messages of one kind in one file: its topic, how each message is encoded (`"json"`), and the
  schema that describes them, if there is one.
  """

  @enforce_keys [:id, :topic, :message_encoding, :schema, :metadata]
  defstruct @enforce_keys

  @typedoc "Its name, which viewers choose a panel by, how it is encoded (`\"jsonschema\"`), and its text."
  @type schema :: {name :: String.t(), encoding :: String.t(), data :: binary()}

  @type t :: %__MODULE__{
          id: 0..0xFFFF,
          topic: String.t(),
          message_encoding: String.t(),
          schema: schema() | nil,
          metadata: %{String.t() => String.t()}
        }
end
