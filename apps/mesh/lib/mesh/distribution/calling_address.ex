defmodule Mesh.Distribution.CallingAddress do
  @moduledoc false
  # Finds where this node calls others from.
  #
  # - A node that listens on one address only, or has an interface, calls from there, since that is where others hear it.
  # - A shell of a release (`-mesh_shell true`, `rel/remote.vm.args.eex`) that root has started calls from a reserved port,
  #   one below 1024, which the kernel gives to no other user: so a robot tells its operator from all other programs
  #   of its machine (`Mesh.Distribution.Access`). A shell of another user calls from any port.
  alias Mesh.Interface

  # As `rresvport(3)`.
  @reserved 512..1023

  @doc "Sets both for the connections that are made from now on."
  @spec set() :: :ok
  def set do
    options = :application.get_env(:kernel, :inet_dist_connect_options, [])
    ip = ip()
    others = Keyword.drop(options, [:ip, :port])
    options = for {key, value} <- [ip: ip, port: port(ip)], value, do: {key, value}
    :application.set_env(:kernel, :inet_dist_connect_options, options ++ others)
  end

  defp ip do
    case {:application.get_env(:kernel, :inet_dist_use_interface), Interface.of_environment()} do
      {{:ok, ip}, _interface} -> ip
      {:undefined, {0, 0, 0, 0}} -> nil
      {:undefined, interface} -> own(interface)
    end
  end

  # While it is absent no node can be called: the loopback has no way to them.
  defp own(interface) do
    case Interface.addresses(interface, Interface.machine_or_none()) do
      [ip | _others] -> ip
      [] -> {127, 0, 0, 1}
    end
  end

  defp port(ip) do
    case :init.get_argument(:mesh_shell) do
      {:ok, _argument} -> free(ip || {0, 0, 0, 0}, first(), Range.size(@reserved))
      :error -> nil
    end
  end

  # Shells that are started at the same time do not begin with the same one.
  defp first, do: rem(:erlang.list_to_integer(:os.getpid()), Range.size(@reserved))

  defp free(_ip, _nth, 0), do: nil

  defp free(ip, nth, left) do
    port = @reserved.first + rem(nth, Range.size(@reserved))

    case :gen_tcp.listen(port, ip: ip) do
      {:ok, socket} ->
        :ok = :gen_tcp.close(socket)
        port

      {:error, :eaddrinuse} ->
        free(ip, nth + 1, left - 1)

      # It is not root's.
      {:error, _refused} ->
        nil
    end
  end
end
