defmodule Console.Terminal.SessionTest do
  # The standard error output is the whole VM's.
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.{FakeTrial, Options, Runs}
  alias Console.Terminal.Session

  defmodule Ended do
    @moduledoc "A fleet whose run ends before its time."
    @behaviour Console.Live
    @impl Console.Live
    def scene(live), do: live |> Agent.get(& &1) |> FakeTrial.scene()
    @impl Console.Live
    def result(live), do: live |> Agent.get(& &1) |> FakeTrial.result()
    @impl Console.Live
    def ended(_live), do: "the world is gone"
    @impl Console.Live
    def command(_live, _command), do: {:ok, "done"}
    @impl Console.Live
    def lines(_live), do: []
    @impl Console.Live
    def pace(_live), do: nil
    @impl Console.Live
    def stop(live), do: Agent.stop(live)
  end

  test "a run that ended before its time is reported, with one line and status 1" do
    options = Runs.options("--robots 2 --duration 60")
    {:ok, trial} = FakeTrial.new(Options.trial(options))
    test = self()

    told =
      capture_io(:stderr, fn ->
        said =
          capture_io(fn ->
            start = fn _options -> Agent.start_link(fn -> trial end) end
            send(test, {:status, Session.run(options, Ended, start)})
          end)

        send(test, {:said, said})
      end)

    assert_received {:status, 1}
    assert_received {:said, said}
    assert said =~ "No formation"
    assert told == "demo: the world is gone\n"
  end
end
