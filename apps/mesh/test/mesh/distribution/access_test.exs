defmodule Mesh.Distribution.AccessTest do
  # The tables have names.
  use ExUnit.Case, async: false
  alias Mesh.Distribution
  alias Mesh.Distribution.Listener
  alias Mesh.Distribution.Access.{Bucket, Networks, Refusals}
  @moduletag :capture_log
  doctest Bucket
  doctest Networks

  @own {10, 0, 0, 1}
  @fellow {10, 0, 0, 2}
  @stranger {10, 0, 0, 66}
  @minutes 60_000

  setup do
    :ok = Refusals.open()
    :ok = Distribution.Access.open({0, 0, 0, 0}, [])
  end

  defp networks(texts) do
    for text <- texts do
      {:ok, network} = Networks.read(text)
      network
    end
  end

  # From a port that anybody may open.
  defp check(ip, called, ms), do: Distribution.Access.check({ip, 1_024}, called, ms)
  defp name(name, ip, called, ms), do: Distribution.Access.name(name, {ip, 1_024}, called, ms)

  test "only this machine may call, until addresses are heard or configured" do
    assert check({127, 0, 0, 1}, {127, 0, 0, 1}, 0) == :ok
    assert check(@own, @own, 0) == :ok
    assert check(@fellow, @own, 0) == {:error, :stranger}
    :ok = Distribution.Access.heard([@fellow], 0)
    assert check(@fellow, @own, 1) == :ok
    assert check(@stranger, @own, 1) == {:error, :stranger}
    assert check({0, 0, 0, 0, 0, 0xFFFF, 0x0A00, 0x0002}, @own, 1) == {:error, :stranger}
    :ok = Distribution.Access.configure(networks(["10.0.0.64/28"]))
    assert check(@stranger, @own, 2) == :ok
    :ok = Distribution.Access.configure([])
    assert check(@stranger, @own, 3) == {:error, :stranger}
  end

  test "with an interface, only who has called that, or the loopback, may connect" do
    for interface <- [@own, "no-card"] do
      :ok = Distribution.Access.open(interface, [])
      :ok = Distribution.Access.heard([@fellow], 0)
      there? = interface == @own
      assert check(@fellow, @own, 1) == :ok == there?
      assert check(@fellow, {10, 0, 1, 1}, 1) == {:error, :elsewhere}
      assert check({10, 0, 1, 1}, {10, 0, 1, 1}, 1) == {:error, :elsewhere}
      # A shell on this machine, whatever address it calls from.
      assert check({10, 0, 1, 1}, {127, 0, 0, 1}, 1) == :ok
      assert check({10, 0, 0, 77}, @own, 1) == {:error, :stranger}
    end
  end

  test "what the environment names stays, whatever the options say" do
    :ok = Distribution.Access.open({0, 0, 0, 0}, networks(["10.0.0.66"]))
    :ok = Distribution.Access.configure([])
    assert check(@stranger, @own, 0) == :ok
    assert Distribution.Access.reachable?(@stranger, 0)
    refute Distribution.Access.reachable?(@fellow, 0)
  end

  test "an address that is not heard for ten minutes is a stranger's again" do
    :ok = Distribution.Access.heard([@fellow], 0)
    assert check(@fellow, @own, 10 * @minutes - 1) == :ok
    assert check(@fellow, @own, 10 * @minutes) == {:error, :stranger}
  end

  test "each address may call 20 times at once, and ten times a second" do
    :ok = Distribution.Access.heard([@fellow], 0)
    attempts = fn ip, ms -> Enum.count(1..100, fn _ -> check(ip, @own, ms) == :ok end) end
    assert attempts.(@fellow, 0) == 20
    assert check(@fellow, @own, 0) == {:error, :too_often}
    assert attempts.(@own, 0) == 20
    assert attempts.(@fellow, 500) == 5
    assert attempts.(@fellow, 60_000) == 20
    # However often it calls in vain.
    in_vain = for ms <- 60_001..61_000, do: check(@fellow, @own, ms)
    assert Enum.count(in_vain, &(&1 == :ok)) == 10
  end

  test "this machine has one rate, whatever address it calls from, and a network has one" do
    :ok = Distribution.Access.configure(networks(["10.0.0.64/28", "10.0.0.20"]))
    local = for n <- 1..100, do: check({127, 1, 2, n}, {127, 0, 0, 1}, 0)
    assert Enum.count(local, &(&1 == :ok)) == 20
    assert check(@own, @own, 0) == {:error, :too_often}
    network = for n <- 1..100, do: check({10, 0, 0, 64 + rem(n, 16)}, @own, 0)
    assert Enum.count(network, &(&1 == :ok)) == 20
    assert check({10, 0, 0, 20}, @own, 0) == :ok
  end

  test "root of this machine has a rate of its own, but not that of another" do
    :ok = Distribution.Access.heard([@fellow], 0)
    for ip <- [@own, @fellow], _ <- 1..100, do: check(ip, @own, 0)
    for n <- 1..100, do: name(~c"not-root-#{n}@nowhere", @own, @own, 0)

    root = fn ip ->
      Enum.count(1..100, &(Distribution.Access.check({ip, 511 + &1}, @own, 0) == :ok))
    end

    assert root.(@own) == 20
    assert root.({127, 0, 0, 1}) == 0
    assert root.(@fellow) == 0
    name = &Distribution.Access.name(~c"root-#{&1}@nowhere", {@own, 1_023}, @own, 0)
    assert Enum.count(1..100, &(name.(&1) == :ok)) == 20
  end

  test "names that have no atom are few, and fewest from fellows' addresses" do
    others = for n <- 1..100, do: {10, 7, 0, n}
    :ok = Distribution.Access.heard(others, 0)
    :ok = Distribution.Access.configure(networks(["10.8.0.0/16"]))

    new = fn ips, ms ->
      Enum.count(ips, &(name(~c"new-#{inspect(&1)}-#{ms}@nowhere", &1, @own, ms) == :ok))
    end

    assert new.(others, 0) == 20
    assert new.(for(n <- 1..100, do: {10, 8, 0, n}), 0) == 20
    assert new.(for(n <- 1..100, do: {127, 8, 0, n}), 0) == 20
    :ok = Distribution.Access.heard(others, @minutes)
    assert new.(others, @minutes) == 1
    assert new.([{127, 0, 0, 1}], @minutes) == 1
    [fellow | _] = others
    assert name(~c"new@nowhere", fellow, @own, @minutes) == {:error, :new_names}
    assert name(~c"new@nowhere", @stranger, @own, @minutes) == {:error, :stranger}
    assert name(Atom.to_charlist(:known@nowhere), fellow, @own, @minutes) == :ok
    assert name(List.duplicate(?x, 300), fellow, @own, @minutes) == {:error, :new_names}
    assert name([255, 0, 8_364], fellow, @own, @minutes) == {:error, :new_names}
  end

  test "the table is bounded, and what is out of date makes room" do
    size = fn -> :ets.info(Distribution.Access, :size) end
    addresses = fn a, count -> for n <- 1..count, do: {10, a, div(n, 256), rem(n, 256)} end
    :ok = Distribution.Access.heard(addresses.(1, 10_000), 0)
    assert size.() <= 10
    :ok = Distribution.Access.heard(addresses.(1, 3_000), 0)
    for ip <- addresses.(1, 3_000), do: check(ip, @own, 0)
    assert size.() <= 4_096
    assert check({10, 1, 11, 184}, @own, 0) == {:error, :too_often}
    assert check({10, 1, 11, 184}, @own, @minutes) == :ok
    :ok = Distribution.Access.heard(addresses.(2, 4_000), 20 * @minutes)
    assert check({10, 2, 0, 1}, @own, 20 * @minutes) == :ok
    assert size.() <= 4_096
  end

  test "without a table nobody is heard, and only this machine is known" do
    :ets.delete(Distribution.Access)
    refute Distribution.Access.there?()
    assert Distribution.Access.heard([@fellow], 0) == :ok
    assert Distribution.Access.configure([]) == :ok
    refute Distribution.Access.reachable?(@fellow, 0)
    assert check(@fellow, @own, 0) == {:error, :stranger}
  end

  test "refusals are counted, and logged once a minute for each address" do
    event = [:mesh, :refused]
    test = self()
    {:ok, _apps} = Application.ensure_all_started(:hal)
    :ok = Hal.Event.attach(__MODULE__, event, fn _, _, about, _ -> send(test, about) end, nil)
    on_exit(fn -> Hal.Event.detach(__MODULE__) end)

    log =
      ExUnit.CaptureLog.capture_log(fn ->
        for _ <- 1..1_000, do: Refusals.note(@stranger, :stranger, 0)
        Refusals.note(@stranger, :stranger, @minutes)
        Refusals.note(@fellow, :too_often, @minutes)
        for _ <- 1..3, do: assert_receive(%{refused: :them, who: nil, address: _, why: _})
        refute_received %{refused: :them}
        # Those that log have ended.
        for n <- 1..40, do: Refusals.note({10, 9, 0, n}, :stranger, @minutes)
        for _ <- 1..18, do: assert_receive(%{address: "10.9.0." <> _})
        refute_receive %{address: _}, 50
      end)

    assert Refusals.counts() == %{stranger: 1_041, too_often: 1, new_names: 0, elsewhere: 0}
    assert log =~ "refused a node at 10.0.0.66: not an address of the fleet\n"
    assert log =~ "10.0.0.66: not an address of the fleet (999 more attempts since"
    assert log =~ "10.0.0.2: it calls too often"
    assert :ets.info(Refusals, :size) <= 24
  end

  test "the listener reads the name of both handshakes, and lets all other messages pass" do
    {:ok, listening} = :gen_tcp.listen(0, ip: {127, 0, 0, 1}, packet: 2, active: false)
    {:ok, port} = :inet.port(listening)

    {:ok, caller} = :gen_tcp.connect({127, 0, 0, 1}, port, [:binary, packet: 2, active: false])

    {:ok, socket} = Listener.accept(listening)
    name = fn n -> "never-#{n}-seen@nowhere" end
    today = fn name -> <<?N, 0::64, 1::32, byte_size(name)::16, name::binary, "more">> end
    before = fn name -> <<?n, 5::16, 0::32, name::binary>> end

    for n <- 1..10, hello <- [today.(name.(2 * n)), before.(name.(2 * n + 1))] do
      :ok = :gen_tcp.send(caller, hello)
      assert Listener.recv(socket, 0, 1_000) == {:ok, String.to_charlist(hello)}
    end

    for hello <- [today.("late@nowhere"), before.("late@nowhere")] do
      :ok = :gen_tcp.send(caller, hello)
      assert Listener.recv(socket, 0, 1_000) == {:error, :closed}
    end

    for other <- ["", "N", "Nshort", "r1234", today.("nonode@nohost")] do
      :ok = :gen_tcp.send(caller, other)
      assert Listener.recv(socket, 0, 1_000) == {:ok, String.to_charlist(other)}
    end

    assert Refusals.counts().new_names == 2
    for _ <- 1..18, do: assert({:ok, _socket} = accepted(listening, port))
  end

  defp accepted(listening, port) do
    {:ok, _caller} = :gen_tcp.connect({127, 0, 0, 1}, port, [])
    Listener.accept(listening)
  end

  test "the listener refuses who calls too often, and then lets in who does not" do
    {:ok, listening} = :gen_tcp.listen(0, ip: {127, 0, 0, 1}, active: false)
    {:ok, port} = :inet.port(listening)
    Process.flag(:priority, :high)
    for _ <- 1..20, do: assert({:ok, _socket} = accepted(listening, port))
    {:ok, refused} = :gen_tcp.connect({127, 0, 0, 1}, port, active: false)
    waiting = Task.async(fn -> accepted_with_priority(listening) end)
    assert :gen_tcp.recv(refused, 0, 10_000) == {:error, :closed}
    assert knock_until(port, waiting) == :high
    assert Refusals.counts().too_often >= 1
  end

  defp accepted_with_priority(listening) do
    Process.flag(:priority, :high)
    {:ok, _socket} = Listener.accept(listening)
    {:priority, priority} = Process.info(self(), :priority)
    priority
  end

  # A tenth of a second later there is an attempt again.
  defp knock_until(port, waiting) do
    _ = :gen_tcp.connect({127, 0, 0, 1}, port, [])

    case Task.yield(waiting, 20) do
      {:ok, priority} -> priority
      nil -> knock_until(port, waiting)
    end
  end
end
