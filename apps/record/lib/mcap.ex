defmodule Mcap do
  @moduledoc """
  Reads and writes MCAP, version 0: a file of messages with time stamps that Foxglove, Lichtblick and Python's `mcap`
  open.

  | module | for |
  |---|---|
  | `Mcap.Writer` | pure: messages to bytes |
  | `Mcap.FileWriter` | the process that writes them into a file, or into a folder that never exceeds a limit |
  | `Mcap.Reader` | messages of a file in order of time, also of one that was cut |
  | `Mcap.Foxglove` | payloads that viewers show in three dimensions, as pictures or as a log |

  Times are whole nanoseconds since 1970.
  """

  @doc "The 8 bytes that begin and end every file."
  @spec magic() :: <<_::64>>
  def magic, do: <<0x89, "MCAP0\r\n">>
end
