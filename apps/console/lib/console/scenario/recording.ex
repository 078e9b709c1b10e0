defmodule Console.Scenario.Recording do
  @moduledoc false
  # Records the run of a scenario for `mix replay`. The run is made again: the same scenario gives the same run, so
  # runs that are not looked at are not recorded.
  alias Lab.{Recorder, Scenario, Trial}
  alias Lab.Scenario.Runner

  @doc "Writes the recording of the whole run; the error is one line."
  @spec record(Scenario.t(), Path.t()) :: :ok | {:error, String.t()}
  def record(%Scenario{} = scenario, path) do
    with {:ok, setup} <- Trial.setup(Scenario.trial(scenario)),
         {:ok, recorder} <- Recorder.start_link(path, setup) do
      run = Runner.begin(scenario, Trial.begin(setup, record: true))
      Runner.play(scenario, run, run.source, &step(&1, &2, recorder))
      Recorder.close(recorder)
    end
  end

  defp step(run, before, recorder) do
    trial = Recorder.step(recorder, before, run.source)
    {%{run | source: trial}, trial}
  end

  @doc """
  The recordings' names of these scenarios, in their order; of two files of one name in different folders, the second gets
  another one.

      iex> Console.Scenario.Recording.names(["a/cut.exs", "kill.exs", "b/cut.exs"])
      ["cut.mcap", "kill.mcap", "cut-2.mcap"]
  """
  @spec names([Path.t()]) :: [String.t()]
  def names(files) do
    {names, _counts} =
      Enum.map_reduce(files, %{}, fn file, counts ->
        name = file |> Path.basename() |> Path.rootname()
        count = Map.get(counts, name, 0) + 1
        number = if count > 1, do: "-#{count}", else: ""
        {name <> number <> ".mcap", Map.put(counts, name, count)}
      end)

    names
  end
end
