defmodule Record.Replayed do
  @moduledoc "A whole recording of live robots, replayed."
  alias Record.{Recording, Replay}

  @doc "Replays all entries of a recording, with what was compared and all differences found."
  @spec replay(Recording.File.t()) :: {Replay.t(), [Replay.difference()]}
  def replay(file) do
    {replay, differences} =
      file
      |> Recording.File.entries()
      |> Enum.reduce({Replay.new(), []}, fn entry, {replay, differences} ->
        {replay, difference} = Replay.step(replay, entry)
        {replay, List.wrap(difference) ++ differences}
      end)

    {replay, last} = Replay.finish(replay)
    {replay, Enum.reverse(differences) ++ last}
  end
end
