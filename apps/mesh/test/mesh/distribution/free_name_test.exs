defmodule Mesh.Distribution.FreeNameTest do
  @moduledoc "The first name whose port is free, on ports that this test holds."
  use ExUnit.Case, async: true
  alias Mesh.Distribution.Epmd.Peers
  alias Mesh.Distribution.FreeName

  # Names of shared ports that no other program of the machine has now.
  defp names(count) do
    Stream.repeatedly(fn -> "free#{:rand.uniform(1_000_000)}" end)
    |> Stream.filter(&match?({:ok, _name}, FreeName.find([&1], %{})))
    |> Stream.uniq_by(&Peers.default_port/1)
    |> Enum.take(count)
  end

  test "names whose ports are taken are passed over; where none is free, the first is named" do
    [one, two] = names(2)
    assert FreeName.find([one, two], %{}) == {:ok, one}
    {:ok, _held} = :gen_tcp.listen(Peers.default_port(one), reuseaddr: true)
    assert FreeName.find([one, two], %{}) == {:ok, two}
    assert {:error, line} = FreeName.find([one], %{})
    assert line =~ "TCP port #{Peers.default_port(one)} of #{one} is in use. If #{one} runs here"
    assert line =~ "CONVOY_DIST_PORT gives #{one} another"
  end

  test "a port of the environment is that of all names" do
    {:ok, held} = :gen_tcp.listen(0, reuseaddr: true)
    {:ok, port} = :inet.port(held)
    assert {:error, line} = FreeName.find(~w(a b), %{"CONVOY_DIST_PORT" => "#{port}"})
    assert line =~ "TCP port #{port} of a is in use"
    assert line =~ "give it another by CONVOY_DIST_PORT"
  end
end
