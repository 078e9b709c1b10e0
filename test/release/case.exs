defmodule Release.Case do
  @moduledoc """
  The release of real robots as a program: it is built once for all tests that use this, each of which has a folder with
  a secret. Processes that a test asks for end with it.
  """
  use ExUnit.CaseTemplate

  @root Path.expand("../..", __DIR__)

  using do
    quote do
      import Release.Case
    end
  end

  setup_all do
    # Whoever comes first builds it; the others find the name taken, and wait for the answer.
    built =
      case Agent.start(&build/0, name: __MODULE__, timeout: :infinity) do
        {:ok, built} -> built
        {:error, {:already_started, built}} -> built
      end

    {said, status} = Agent.get(built, & &1, :infinity)
    assert status == 0, said

    {:ok, _started} = Application.ensure_all_started(:hal)
    :ok
  end

  defp build do
    environment = [{"MIX_ENV", "prod"}, {"MIX_TARGET", nil}, {"CONVOY_BUILD", "robot"}]
    arguments = ["release", "robot", "--overwrite", "--quiet"]
    options = [cd: @root, env: environment, stderr_to_stdout: true]
    System.cmd("mix", arguments, options)
  end

  setup do
    folder =
      Path.join(System.tmp_dir!(), "convoy-release-#{System.pid()}-#{:rand.uniform(10_000)}")

    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    {:ok, _secret} = Mesh.Secret.create(Path.join(folder, "secret"), false)
    %{folder: folder}
  end

  @doc "Where the release is."
  def release, do: Path.join(@root, "_build/prod/rel/robot")

  @doc "Writes a robot file, with ports of its own, so that it meets no other fleet of this machine."
  def robot_file(path, port, more \\ "") do
    free = free_port(:erlang.phash2({System.pid(), make_ref()}))

    File.write!(path, """
    [
      id: :mag1,
      profile: :magellan,
      drive: {Hal.RFlex.Driver, [port: "#{port}", conversions: [distance: 31_387.0, angle: 4654.2,
        range: 1474.0, ir_a: 4000.0, ir_b: -2.0]]},
      network: [interface: "127.0.0.1", port: 0, multicast: false, dist_port: #{free}]#{more}
    ]
    """)
  end

  # Below those that the system gives to connections: one of these might have taken it by the time the robot starts.
  defp free_port(number) do
    port = 12_000 + rem(number, 18_000)

    case :gen_tcp.listen(port, ip: {127, 0, 0, 1}) do
      {:ok, socket} ->
        :gen_tcp.close(socket)
        port

      {:error, :eaddrinuse} ->
        free_port(number + 1)
    end
  end

  @doc "What `bin/robot` prints, and its status."
  def robot(arguments, environment) do
    options = [env: environment, stderr_to_stdout: true]
    System.cmd(Path.join(@root, "bin/robot"), arguments, options)
  end

  @doc "Asks until the answer is such."
  def until(pattern, ask, left_ms \\ 60_000) do
    began = System.monotonic_time(:millisecond)
    {said, _status} = ask.()

    if said =~ pattern do
      said
    else
      if left_ms < 0, do: flunk("it never said #{inspect(pattern)}, but: #{said}")
      # Each question is a VM, which takes the processor from the robot.
      receive(do: (:never -> :ok), after: (200 -> :ok))
      until(pattern, ask, left_ms - (System.monotonic_time(:millisecond) - began))
    end
  end

  @doc "Whether there is such a process, and it has not ended: one that its parent has not seen end has."
  def there?(pid) do
    case File.read("/proc/#{pid}/status") do
      {:ok, status} -> not (status =~ ~r/^State:\tZ/m)
      {:error, gone} when gone in [:enoent, :esrch] -> false
    end
  end

  @doc "The number of the robot's process, which ends with the test."
  def pid(ask) do
    pid = ask |> then(&until(~r/^\d+$/m, &1)) |> String.trim()
    on_exit(fn -> System.cmd("kill", ["-KILL", pid], stderr_to_stdout: true) end)
    pid
  end
end
