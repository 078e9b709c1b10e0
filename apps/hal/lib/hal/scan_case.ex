defmodule Hal.ScanCase do
  @moduledoc """
  Runs the driver of any lidar at one that is emulated, and says what does not hold that must hold for all. For tests:

      @tag timeout: 300_000
      test "what holds for every lidar" do
        assert Hal.ScanCase.problems({Hal.Lds.Driver, model: :lds02}, {Sim.Emulator, core: {Sim.Emulator.Lds, model: :lds02}}) == []
      end

  `Hal.Device` runs the driver, as in a robot, with the lidar's line as its option `port:`; the lidar is a `Hal.Emulated` with the
  callback below, such as `Sim.Emulator`. Each rule is a run of its own, in real time.

  | rule | must hold |
  |---|---|
  | `:options` | an option that it does not know is refused in one line that names it |
  | `:missing` | a port that is not there is an error, and in words one line that names it; once it is there it sees |
  | `:sees` | what is near in one direction is there in its scans, to 5 cm and 2 degrees, and nothing where nothing is |
  | `:turned` | the same to the left as to the right: no scan is mirrored |
  | `:junk` | noise on the line neither ends it nor makes its state grow, and it sees on |
  | `:messages` | nor do messages that it does not know |
  | `:unplug` | a pulled cable is an error, and once it is back it sees again |
  | `:restart` | a lidar that is switched off and on is found again |
  | `:program` | so is one whose port program was killed |
  | `:close`, `:killed` | after the end of the device, or the killing of its process, nothing comes, and no program of its runs on (on Linux) |
  """
  alias Hal.{DeviceCase, Options, Scan}
  import Hal.DeviceCase, only: [await: 3, on_emulated: 3, tell: 3]

  @doc "What the lidar has around it from now on."
  @callback see(GenServer.server(), Scan.t()) :: :ok

  @rules DeviceCase.rules([:sees, :turned])
  @table DeviceCase.table(@rules, 300_000)
  @degree :math.pi() / 180
  # What is seen is as far away as this (metres), and so wide to each side (degrees).
  @near 0.8
  @wide 5
  @exact 0.05

  @doc """
  What does not hold, one line each. Options: `only` (these rules), `wait_ms` (how long a busy machine may take for what must come,
  20,000), `bytes` (how large the device's state may be, 300,000), `seed` (of the noise). Raises `ArgumentError` for options
  that are wrong.
  """
  @spec problems(driver :: {module(), keyword()}, lidar :: {module(), keyword()}, keyword()) ::
          [String.t()]
  def problems({_, _} = driver, {_, _} = lidar, options \\ []) do
    options = Options.check!(options, @table, "scan case")
    t = %DeviceCase{kind: :scan, driver: driver, emulated: lidar, options: options}
    DeviceCase.problems(t, &rule/2)
  end

  defp rule(:sees, t), do: on_emulated(t, [], &sees(&1, 0, "what is ahead"))

  defp rule(:turned, t) do
    on_emulated(t, [], fn t ->
      with :ok <- sees(t, 90, "what is to the left"), do: sees(t, -60, "what is to the right")
    end)
  end

  defp rule(rule, t), do: DeviceCase.rule(rule, t, &sees(&1, 120 * &2, &3))

  # Something near there, and nothing else within its reach.
  defp sees(t, degrees, what) do
    :ok = tell(t, :see, [around(degrees)])
    with {:ok, _scan} <- await(t, "does not see #{what}", &seen(&1, degrees)), do: :ok
  end

  defp around(degrees) do
    rays =
      for k <- 0..359, into: <<>> do
        off = Integer.mod(k - degrees + 180, 360) - 180
        Scan.pack(if(abs(off) <= @wide, do: @near))
      end

    %Scan{start: 0.0, step: @degree, ranges: rays}
  end

  # All echoes are there, and most of those that should be.
  defp seen({:scan, scan}, degrees) do
    echoes = Scan.echoes(scan, 60.0)

    there =
      Enum.filter(echoes, fn {direction, range} ->
        off = Hal.Pose.wrap(direction - degrees * @degree)
        abs(off) <= (@wide + 2) * @degree and abs(range - @near) < @exact
      end)

    if there == echoes and length(there) >= @wide, do: {:ok, scan}
  end

  defp seen(_other, _degrees), do: nil
end
