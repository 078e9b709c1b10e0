defmodule Soak.Logs do
  @moduledoc "Reads what is new in the logs that nodes write (`Soak.Recorder`), while they write."

  @most_bytes 4_000_000

  @type offsets :: %{atom() => non_neg_integer()}

  @doc "The events since the last call, by time, and where to go on."
  @spec read(Path.t(), [atom()], offsets()) :: {[Soak.Judge.event()], offsets()}
  def read(folder, robots, offsets) do
    {events, offsets} =
      Enum.flat_map_reduce(robots, offsets, fn robot, offsets ->
        {events, size} = news(Path.join(folder, "#{robot}.log"), Map.get(offsets, robot, 0))
        {events, Map.put(offsets, robot, size)}
      end)

    {Enum.sort_by(events, &elem(&1, 0)), offsets}
  end

  @doc "Keeps the logs of a run beside its journal, in a folder of the same name without `.log`; returns it."
  @spec keep(Path.t(), journal :: Path.t()) :: Path.t()
  def keep(folder, journal) do
    kept = Path.rootname(journal)
    File.mkdir_p!(kept)

    for path <- Path.wildcard(Path.join(folder, "*.log")),
        do: File.cp!(path, Path.join(kept, Path.basename(path)))

    kept
  end

  # Only what is new in the file, and of that only whole lines.
  defp news(path, offset) do
    with {:ok, file} <- :file.open(path, [:read, :raw, :binary]) do
      text = with :eof <- pread(file, offset), do: ""
      :ok = :file.close(file)
      whole = text |> String.split("\n") |> Enum.drop(-1)
      {Enum.flat_map(whole, &parse/1), offset + Enum.sum(Enum.map(whole, &(byte_size(&1) + 1)))}
    else
      {:error, :enoent} -> {[], offset}
    end
  end

  defp pread(file, offset),
    do: with({:ok, text} <- :file.pread(file, offset, @most_bytes), do: text)

  # A node that is killed while it writes leaves half a line, to which the next life adds its first.
  defp parse(line) do
    with {:ok, tokens, _end} <- line |> String.to_charlist() |> :erl_scan.string(),
         {:ok, {_us, _who, _kind, _value} = event} <- :erl_parse.parse_term(tokens) do
      [event]
    else
      _half -> []
    end
  end
end
