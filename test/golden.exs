# What bin/golden does: see there.
defmodule Golden do
  alias Console.{Options, Report}

  @file_name Path.join(__DIR__, "golden.txt")

  def run(arguments) when arguments in [[], ["--write"]] do
    lines = @file_name |> File.read!() |> String.split("\n", trim: true)

    results =
      lines
      |> Task.async_stream(&line/1, timeout: :infinity, ordered: true)
      |> Enum.map(fn {:ok, {before, now}} ->
        IO.puts(now)
        {before, now}
      end)

    changed = Enum.count(results, fn {before, now} -> before != now end)

    cond do
      changed == 0 ->
        :ok

      arguments == ["--write"] ->
        File.write!(@file_name, Enum.map(results, fn {_before, now} -> [now, "\n"] end))
        IO.puts(:stderr, "#{changed} digests written")

      true ->
        all = Enum.count(lines, &(not String.starts_with?(&1, "#")))
        IO.puts(:stderr, "bin/golden: #{changed} of #{all} reports differ from test/golden.txt")

        System.halt(1)
    end
  end

  def run(arguments) do
    IO.puts(:stderr, "bin/golden: #{Enum.join(arguments, " ")}: only --write is allowed")
    System.halt(1)
  end

  # "digest  options", or a remark.
  defp line("#" <> _ = remark), do: {remark, remark}

  defp line(line) do
    [_digest, text] = String.split(line, "  ", parts: 2)
    Lab.Trial.Memory.prepare()
    {:ok, options} = text |> String.split() |> Options.parse()
    {:ok, trial} = options |> Options.trial() |> Lab.Trial.new()
    report = trial |> Lab.Run.play() |> Lab.Trial.result() |> Report.json(0.0)
    {line, "#{digest(report)}  #{text}"}
  end

  defp digest(report),
    do: :sha256 |> :crypto.hash(report) |> Base.encode16(case: :lower) |> binary_part(0, 16)
end

Golden.run(System.argv())
