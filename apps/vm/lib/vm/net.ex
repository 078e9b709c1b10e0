defmodule Vm.Net do
  @moduledoc """
  Builds a network of our own on this machine: a namespace with two bridges (the switch), and one for each robot, with a
  cable to the switch and no route but that to its network. Nothing of it is seen outside, and it goes with the process that made
  it, however that ends. Guests have namespaces and cables as robots do, and belong to no fleet.

      net = Vm.Net.create([:mag1, :mag2, :mag3], folder)
      Vm.Net.split(net, [[:mag1, :mag2], [:mag3]])
      Vm.Net.block(net, :mag1, :mag2)
      Vm.Net.lose(net, 0.2)
      Vm.Net.heal(net)
  """

  @look_ms 50

  @enforce_keys [:prefix, :robots, :guard]
  defstruct @enforce_keys ++ [guests: []]

  @type t :: %__MODULE__{
          prefix: String.t(),
          robots: [atom()],
          guard: port(),
          guests: [atom()]
        }

  # Reads until its input ends, which is when the VM that opened it does. A veth goes at once and takes its
  # other end along; a namespace goes when the kernel has time.
  @guard """
  exec >/dev/null 2>&1
  trap '' INT TERM HUP
  cat
  folder=$1; shift
  for name in "$@"; do
    for pid in $(ip netns pids "$name"); do kill -9 "$pid"; done
  done
  port=1
  while ip -n "$1" link del "p$port"; do port=$((port + 1)); done
  rm -rf "$folder"
  for name in "$@"; do ip netns del "$name"; done
  """

  @doc "Why there cannot be one on this machine, in a line, or `nil`."
  @spec why_not() :: String.t() | nil
  def why_not do
    cond do
      :os.type() != {:unix, :linux} -> "network namespaces are Linux's"
      System.find_executable("ip") == nil -> "there is no program ip (Debian: iproute2)"
      System.find_executable("iptables") == nil -> "there is no program iptables"
      System.cmd("id", ["-u"]) != {"0\n", 0} -> "only root may make network namespaces"
      true -> try_one("convoy#{random()}")
    end
  end

  # Some containers have a root that may not.
  defp try_one(name) do
    bridge = ~w(-n #{name} link add br0 type bridge)
    rule = ~w(netns exec #{name} iptables -A INPUT) ++ loss(0.2)

    case Enum.find_value([~w(netns add #{name}), bridge, rule], &refused/1) do
      nil -> nil
      why -> "this machine refuses: #{why}"
    end
  after
    System.cmd("ip", ~w(netns del #{name}), stderr_to_stdout: true)
  end

  defp refused(arguments) do
    case System.cmd("ip", arguments, stderr_to_stdout: true) do
      {_text, 0} -> nil
      {text, _status} -> text |> String.split("\n") |> hd()
    end
  end

  @doc "Makes a network of these robots and guests, each of which reaches all. The folder goes with it."
  @spec create([atom(), ...], Path.t(), [atom()]) :: t()
  def create(robots, folder, guests \\ []) do
    prefix = "convoy#{random()}"
    names = for who <- [:switch | robots ++ guests], do: "#{prefix}-#{who}"
    guard = guard(folder, names)
    net = %__MODULE__{prefix: prefix, robots: robots, guard: guard, guests: guests}
    Enum.each(names, &ip(~w(netns add #{&1})))

    for bridge <- ~w(br0 br1) do
      ip(~w(-n #{hd(names)} link add #{bridge} type bridge mcast_snooping 0))
      ip(~w(-n #{hd(names)} link set #{bridge} up))
    end

    for who <- robots ++ guests, do: plug_in(net, who)
    net
  end

  defp plug_in(net, robot) do
    {switch, there, port} = {space(net, :switch), space(net, robot), port(net, robot)}
    ip(~w(-n #{switch} link add #{port} type veth peer name eth0 netns #{there}))
    ip(~w(-n #{switch} link set #{port} master br0 up))
    ip(~w(-n #{there} addr add #{text(address(net, robot))}/24 dev eth0))
    ip(~w(-n #{there} link set lo up))
    ip(~w(-n #{there} link set eth0 up))
  end

  @doc "Ends it, and waits until its names are free."
  @spec delete(t()) :: :ok
  def delete(net) do
    if Port.info(net.guard), do: Port.close(net.guard)
    await_gone(net, System.monotonic_time(:millisecond) + 10_000)
  end

  defp await_gone(net, deadline) do
    {names, 0} = System.cmd("ip", ~w(netns list), stderr_to_stdout: true)

    cond do
      not String.contains?(names, net.prefix) -> :ok
      System.monotonic_time(:millisecond) < deadline -> await_gone_later(net, deadline)
      true -> raise "namespaces #{net.prefix}-… do not go"
    end
  end

  # The kernel takes its time.
  defp await_gone_later(net, deadline) do
    receive do
    after
      @look_ms -> await_gone(net, deadline)
    end
  end

  @doc "The namespace of a robot or guest."
  @spec space(t(), atom()) :: String.t()
  def space(net, robot), do: "#{net.prefix}-#{robot}"

  @doc "The address of a robot or guest."
  @spec address(t(), atom()) :: :inet.ip4_address()
  def address(net, robot), do: {10, 77, 0, number(net, robot)}

  @doc "Runs the program `ip` with these arguments in the namespace of a robot or guest, for cards and routes of its own."
  @spec ip(t(), atom(), [String.t()]) :: :ok
  def ip(net, who, arguments), do: ip(["-n", space(net, who) | arguments])

  @doc "Cuts it in two: the second group's cables go into the other bridge."
  @spec split(t(), [[atom()]]) :: :ok
  def split(net, [_stay, go]) do
    for robot <- go, do: ip(~w(-n #{space(net, :switch)} link set #{port(net, robot)} master br1))
    :ok
  end

  @doc "Cuts the link between two: whatever comes from the other's address is dropped, by any protocol."
  @spec block(t(), atom(), atom()) :: :ok
  def block(net, a, b) do
    for {here, there} <- [{a, b}, {b, a}],
        do: rule(net, here, ~w(-A INPUT -s #{text(address(net, there))} -j DROP))

    :ok
  end

  @doc "Gives a robot another address, as a server of addresses might, and takes the one that it has."
  @spec move(t(), atom()) :: :ok
  def move(net, robot) do
    there = space(net, robot)
    ip(~w(-n #{there} addr flush dev eth0))
    ip(~w(-n #{there} addr add #{text(moved(net, robot))}/24 dev eth0))
  end

  @doc "The address of a robot that has moved."
  @spec moved(t(), atom()) :: :inet.ip4_address()
  def moved(net, robot), do: {10, 77, 0, 100 + number(net, robot)}

  @doc "Loses this share of all packets."
  @spec lose(t(), float()) :: :ok
  def lose(net, share) do
    for robot <- net.robots, do: rule(net, robot, ~w(-A INPUT -i eth0) ++ loss(share))
    :ok
  end

  @doc "All reach all again."
  @spec heal(t()) :: :ok
  def heal(net) do
    for robot <- net.robots do
      rule(net, robot, ~w(-F INPUT))
      ip(~w(-n #{space(net, :switch)} link set #{port(net, robot)} master br0))
    end

    :ok
  end

  defp loss(share), do: ~w(-m statistic --mode random --probability #{share} -j DROP)

  defp rule(net, robot, rule), do: ip(~w(netns exec #{space(net, robot)} iptables -w) ++ rule)

  defp ip(arguments) do
    case System.cmd("ip", arguments, stderr_to_stdout: true) do
      {_text, 0} -> :ok
      {text, _status} -> raise "ip #{Enum.join(arguments, " ")}: #{text}"
    end
  end

  defp guard(folder, names) do
    arguments = ["-c", @guard, "sh", folder | names]
    Port.open({:spawn_executable, System.find_executable("sh")}, [:out, args: arguments])
  end

  defp port(net, robot), do: "p#{number(net, robot)}"
  defp number(net, who), do: Enum.find_index(net.robots ++ net.guests, &(&1 == who)) + 1
  defp text(address), do: address |> :inet.ntoa() |> List.to_string()
  defp random, do: 4 |> :crypto.strong_rand_bytes() |> Base.encode16(case: :lower)
end
