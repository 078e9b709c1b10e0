defmodule Mcap.DamagedError do
  @moduledoc "Says that a chunk in the middle of a recording is not as it was written. The message is one line."
  defexception [:message]
end
