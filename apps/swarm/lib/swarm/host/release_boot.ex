defmodule Swarm.Host.ReleaseBoot do
  @moduledoc """
  Determines at the start of a release which robot this machine is, from which file and with which
  network. `rel/env.sh.eex` asks before Erlang starts, `Swarm.Application` when it starts.

  The robot file is the first of these that exists:

    1. the one that `CONVOY_ROBOT_FILE` names;
    2. `/etc/convoy/robots/NAME.exs`, the machine's own;
    3. `robots/NAME.exs` of the release, as it was built or deployed.

  NAME is `ROBOT` of the environment. The release `robot` does not start without one; in `fleet` a
  name without a file is a base station, a node without a robot.
  """
  alias Robot.File.Summary
  alias Swarm.Host.{Machine, PowerOff}
  alias Mesh.{Environment, Interface, Secret}
  alias Mesh.Distribution.Epmd
  alias Swarm.MemberSpec

  @machine "/etc/convoy/robots"
  @starts ~w(start start_iex daemon daemon_iex)
  @patience_ms 3_000

  @type environment :: %{optional(String.t()) => String.t()}

  @doc """
  The path of the robot file; `nil` if none is needed.

      iex> there? = &(&1 == "/opt/convoy/robots/mag1.exs")
      iex> Swarm.Host.ReleaseBoot.place(%{"ROBOT" => "mag1", "RELEASE_ROOT" => "/opt/convoy"}, there?)
      {:ok, "/opt/convoy/robots/mag1.exs"}
      iex> Swarm.Host.ReleaseBoot.place(%{"ROBOT" => "base", "RELEASE_ROOT" => "/opt/convoy"}, there?)
      {:ok, nil}
  """
  @spec place(environment(), there? :: (Path.t() -> boolean())) ::
          {:ok, Path.t() | nil} | {:error, line :: String.t()}
  def place(environment, there? \\ &File.exists?/1) do
    name = value(environment, "ROBOT")

    with nil <- value(environment, "CONVOY_ROBOT_FILE"),
         places = places(name, value(environment, "RELEASE_ROOT")),
         nil <- Enum.find(places, there?) do
      if value(environment, "RELEASE_NAME") == "robot",
        do: {:error, "#{name} has no robot file; looked for #{Enum.join(places, " and ")}"},
        else: {:ok, nil}
    else
      path -> {:ok, path}
    end
  end

  @doc "The checked robot of this machine; the error lists all that is wrong, one line each."
  @spec robot(environment()) ::
          {:ok, {Robot.File.t(), Robot.Config.t()} | nil} | {:error, [line :: String.t(), ...]}
  def robot(environment) do
    with {:ok, path} when path != nil <- place(environment),
         {:ok, file} <- MemberSpec.load(path),
         :ok <- named(file, path, value(environment, "ROBOT")),
         {:ok, config} <- MemberSpec.config(file) do
      {:ok, {file, config}}
    else
      {:ok, nil} -> {:ok, nil}
      {:error, lines} -> {:error, List.wrap(lines)}
    end
  end

  @doc """
  What a shell must know to start the robot or to reach it: the path of the secret, the cookie
  derived from it, the port of distribution, and its interface as text, `nil` for all.
  The robot file takes precedence over the environment.
  """
  @spec settings(environment(), Robot.File.t() | nil) ::
          {:ok,
           %{
             secret_file: Path.t(),
             cookie: String.t(),
             dist_port: :inet.port_number(),
             interface: String.t() | nil
           }}
          | {:error, line :: String.t()}
  def settings(environment, file) do
    network = if file, do: MemberSpec.mesh(file), else: []
    secret_file = network[:secret_file] || value(environment, "CONVOY_SECRET_FILE")

    with {:ok, secret} <- secret(secret_file, network, value(environment, "CONVOY_SECRET_FILE")) do
      {:ok,
       %{
         secret_file: secret.path,
         cookie: Atom.to_string(secret.cookie),
         dist_port: network[:dist_port] || dist_port(environment),
         interface: text(network[:interface]) || value(environment, "CONVOY_INTERFACE")
       }}
    end
  end

  # The error must say that the environment's value was not even read.
  defp secret(path, network, told) do
    with {:error, line} <- Secret.from_env(%{"CONVOY_SECRET_FILE" => path || ""}) do
      if network[:secret_file] && told not in [nil, path],
        do:
          {:error,
           "#{line} (network.secret_file of the robot file takes precedence over #{told})"},
        else: {:error, line}
    end
  end

  @doc """
  The answer to `rel/env.sh.eex`: status and lines of standard output and standard error. For
  `check` they say what the robot is, and what this machine lacks for it, for `halt` that its controller was told to cut the power
  (`Swarm.Host.PowerOff`), else they are the settings. Commands that only reach a running robot,
  for example to stop it, work even if its file has become wrong since. Nothing starts if the port
  of its distribution is taken for longer than `patience_ms`; a robot that was told to stop may
  need a second.
  """
  @spec answer(command :: String.t(), environment(), patience_ms :: non_neg_integer()) ::
          {status :: 0 | 1, output :: [String.t()], errors :: [String.t()]}
  def answer(command, environment, patience_ms \\ @patience_ms) do
    case {checked(environment), command} do
      {{:ok, robot}, "halt"} ->
        halt(environment, file(robot))

      {{:ok, robot}, "check"} ->
        told(environment, file(robot), &about(environment, &1, &2))

      {{:ok, robot}, command} when command in @starts ->
        told(environment, file(robot), &begins(environment, &1, &2, patience_ms))

      {{:ok, robot}, _command} ->
        told(environment, file(robot), &shell/2)

      {{:error, lines}, command} ->
        wrong(command, environment, lines)
    end
  end

  # What is wrong in the environment, and what is wrong in the file.
  defp checked(environment) do
    case {Environment.check(environment), robot(environment)} do
      {:ok, robot} -> robot
      {{:error, lines}, {:error, more}} -> {:error, lines ++ more}
      {error, {:ok, _robot}} -> error
    end
  end

  @doc "Prints that answer, and ends the VM unless all is well."
  @spec main() :: :ok
  def main do
    environment = System.get_env()
    configure(environment)
    {status, output, errors} = answer(Map.get(environment, "RELEASE_COMMAND", ""), environment)
    Enum.each(errors, &IO.puts(:stderr, &1))
    Enum.each(output, &IO.puts/1)
    if status != 0, do: System.halt(status), else: :ok
  end

  # This VM runs without the release's settings, because they would include those of the start.
  # The missions, the formations and the recorder that a robot file may ask for are settings of the build.
  defp configure(environment) do
    with %{"RELEASE_ROOT" => root, "RELEASE_VSN" => version} <- environment,
         {:ok, [settings]} <- :file.consult(Path.join([root, "releases", version, "sys.config"])) do
      words =
        settings
        |> Keyword.get(:swarm, [])
        |> Keyword.take([:missions, :formations, :recorder, :incidents])

      Application.put_all_env(swarm: words)
    end
  end

  defp halt(environment, file) do
    case PowerOff.say(file) do
      {:ok, line} -> {0, [line], []}
      {:error, line} -> {1, [], ["#{environment["ROBOT"]}: #{line}"]}
    end
  end

  defp wrong(command, environment, lines) when command in ~w(remote rpc stop restart pid) do
    {status, output, errors} = told(environment, nil, &shell/2)
    {status, output, lines ++ errors}
  end

  defp wrong(_command, _environment, lines), do: {1, [], lines}

  defp told(environment, file, tell) do
    case settings(environment, file) do
      {:ok, settings} -> answered(tell.(settings, file))
      {:error, line} -> {1, [], [line]}
    end
  end

  defp answered({:error, line}), do: {1, [], [line]}
  defp answered(lines), do: {0, lines, []}

  defp begins(environment, settings, file, patience_ms) do
    port = settings.dist_port

    if free?(port, patience_ms),
      do: shell(settings, file),
      else:
        {:error,
         "#{environment["ROBOT"]} does not start: its TCP port #{port} is in use. Either it runs here already " <>
           "(robot status tells how it is, robot stop ends it), or another program has the port (ss -ltnp), " <>
           "and dist_port: of its file, or CONVOY_DIST_PORT, names another"}
  end

  # In the same way as Erlang's distribution will listen.
  defp free?(port, left_ms) do
    case :gen_tcp.listen(port, reuseaddr: true) do
      {:error, :eaddrinuse} when left_ms > 0 ->
        receive(do: (:never -> :ok), after: (100 -> free?(port, left_ms - 100)))

      {:error, :eaddrinuse} ->
        false

      # Erlang reports other errors of it better.
      {:error, _other} ->
        true

      {:ok, socket} ->
        :gen_tcp.close(socket) == :ok
    end
  end

  defp shell(s, _file), do: [s.cookie, s.secret_file, to_string(s.dist_port), s.interface || ""]

  defp about(environment, settings, file),
    do: words(environment, file) ++ Machine.lacks(interface(settings))

  defp words(environment, nil), do: ["#{environment["ROBOT"]}: a node without a robot"]

  defp words(environment, file) do
    {:ok, path} = place(environment)
    Summary.report(path, file)
  end

  # That of the file was checked with it, that of the environment before.
  defp interface(%{interface: nil}), do: {0, 0, 0, 0}
  defp interface(%{interface: text}), do: text |> Interface.read() |> elem(1)

  defp file({file, _config}), do: file
  defp file(nil), do: nil

  defp places(name, nil), do: [Path.join(@machine, "#{name}.exs")]
  defp places(name, root), do: places(name, nil) ++ [Path.join([root, "robots", "#{name}.exs"])]

  defp named(%{id: id}, path, name) do
    if Atom.to_string(id) == name,
      do: :ok,
      else: {:error, "#{path} is that of #{id}, and this machine is ROBOT=#{name}"}
  end

  defp dist_port(environment) do
    case Integer.parse(value(environment, "CONVOY_DIST_PORT") || "") do
      {port, ""} when port in 1..65_535 -> port
      _none -> Epmd.default_port(value(environment, "ROBOT") || "")
    end
  end

  defp text(nil), do: nil
  defp text(interface), do: Interface.text(interface)

  defp value(environment, name) do
    case environment do
      %{^name => value} when value != "" -> value
      _none -> nil
    end
  end
end
