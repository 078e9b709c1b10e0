defmodule Console.Runs do
  @moduledoc "Runs of the fake trial for the tests of the views."
  alias Console.{FakeTrial, Options}
  alias Console.Picture.RunTrack
  alias Lab.{Recording, Replay}

  @doc "Options from one command line, and words that follow it as they are, such as paths."
  @spec options(String.t(), [String.t()]) :: Options.t()
  def options(line, words \\ []) do
    {:ok, options} = Options.parse(OptionParser.split(line) ++ words)
    options
  end

  @doc "The scene after some simulated seconds."
  @spec scene(String.t(), number()) :: Sim.Scene.t()
  def scene(line, at_s) do
    {:ok, trial} = line |> options() |> Options.trial() |> FakeTrial.new()

    trial
    |> Stream.iterate(&FakeTrial.step/1)
    |> Enum.at(round(at_s * 10))
    |> FakeTrial.scene()
  end

  @doc "Replays a recording; what differs raises. Returns its end."
  @spec replayed_ms(Path.t()) :: non_neg_integer()
  def replayed_ms(path) do
    {:ok, file} = Recording.File.open(path)

    for_each = fn tick, replay ->
      {replay, []} = Replay.step(replay, tick)
      replay
    end

    file
    |> Recording.File.ticks()
    |> Enum.reduce(Replay.new(file.setup), for_each)
    |> Replay.at_ms()
  end

  @doc "The track of a whole run."
  @spec track(String.t()) :: RunTrack.t()
  def track(line) do
    {:ok, trial} = line |> options() |> Options.trial() |> FakeTrial.new()
    follow(FakeTrial.step(trial), RunTrack.new(FakeTrial.scene(trial)))
  end

  defp follow(trial, track) do
    track = RunTrack.add(track, FakeTrial.scene(trial))
    if FakeTrial.done?(trial), do: track, else: follow(FakeTrial.step(trial), track)
  end
end
