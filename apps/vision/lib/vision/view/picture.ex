defmodule Vision.View.Picture do
  @moduledoc "Holds a JPEG picture of a frame; `at_ms` is the frame's time."

  @enforce_keys [:jpeg, :width, :height, :at_ms]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          jpeg: binary(),
          width: pos_integer(),
          height: pos_integer(),
          at_ms: integer()
        }
end
