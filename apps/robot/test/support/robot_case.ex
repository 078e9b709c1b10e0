defmodule Robot.Case do
  @moduledoc """
  A robot with fake drivers (see `Hal.Fake`), which tell the test process what they are asked to
  do. Robots of all tests live in one registry, so each test uses ids of its own.
  """
  use ExUnit.CaseTemplate

  using do
    quote do
      import Robot.Case
    end
  end

  setup do
    # In the umbrella one VM runs the tests of all apps, and a fleet may be running already.
    if Process.whereis(Robot.Names) == nil, do: start_supervised!(Robot.Names)
    :ok
  end

  @doc "A config with fake drivers; `options` replace."
  def config(id, options \\ []) do
    [
      id: id,
      profile: Hal.Profile.magellan(),
      drive: {Hal.FakeDrive, test: self(), device: :drive}
    ]
    |> Keyword.merge(options)
    |> Robot.Config.new!()
  end
end
