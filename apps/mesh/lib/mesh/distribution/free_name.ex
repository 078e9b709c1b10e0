defmodule Mesh.Distribution.FreeName do
  @moduledoc """
  Finds the name that a node on this machine can have, for `bin/node`, which asks before Erlang starts: Erlang itself
  says of a port that is taken only `eaddrinuse`.
  """
  alias Mesh.Distribution.Epmd.Peers

  # base, base2, ... base9.
  @most 9

  @doc """
  For scripts: `name` with `one` takes this name, with `any` the first that is free of `name`, `name2` to `name9`. Prints
  it, or says on standard error in one line what is in the way, and ends with status 1.
  """
  @spec main([String.t()]) :: :ok | no_return()
  def main([name, which]) do
    names = if which == "any", do: [name | Enum.map(2..@most, &"#{name}#{&1}")], else: [name]

    case find(names, System.get_env()) do
      {:ok, free} ->
        IO.puts(free)

      {:error, line} ->
        IO.puts(:stderr, "bin/node: " <> line)
        System.halt(1)
    end
  end

  @doc """
  The first of these names whose port is free; the ports are those of `Mesh.Distribution.Epmd` with this
  environment. The error is one line for people.
  """
  @spec find([String.t(), ...], %{optional(String.t()) => String.t()}) ::
          {:ok, String.t()} | {:error, line :: String.t()}
  def find([first | _] = names, environment) do
    with nil <- Enum.find(names, &free?(Peers.own_port(&1, environment))),
         do: {:error, line(first, Peers.own_port(first, environment), environment)},
         else: (name -> {:ok, name})
  end

  defp line(name, port, environment) do
    way =
      if environment["CONVOY_DIST_PORT"] in [nil, ""],
        do: "CONVOY_DIST_PORT gives #{name} another",
        else: "give it another by CONVOY_DIST_PORT"

    "TCP port #{port} of #{name} is in use. If #{name} runs here already, this node needs another name; if another " <>
      "program has the port (ss -ltnp tells), #{way}"
  end

  # Other errors Erlang tells better itself; port 0 is any.
  defp free?(port) do
    case :gen_tcp.listen(port, reuseaddr: true) do
      {:error, :eaddrinuse} -> false
      {:error, _other} -> true
      {:ok, socket} -> :gen_tcp.close(socket) == :ok
    end
  end
end
