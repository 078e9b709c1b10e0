defmodule Mesh.Distribution.ConnectionLog.Peer do
  @moduledoc false
  # Finds the peer of a TLS handshake, for the log: the name in its certificate, and its address, which is gone once it has
  # hung up. Erlang calls `verify/3` in the process of the connection, which keeps both until it ends.
  alias Mesh.Distribution.ConnectionLog.Address

  @doc """
  The `verify_fun` of `ssl_dist.conf`: decides as OTP does, except for host names, and remembers
  the peer.
  """
  @spec verify(tuple(), term(), term()) :: {:valid | :unknown | :fail, term()}
  # OTP compares the host part of the node's name with the names in the certificate. Our host part
  # is not a host name.
  def verify(_certificate, {:bad_cert, :hostname_check_failed}, state), do: {:valid, state}

  def verify(certificate, {:bad_cert, _reason} = problem, _state) do
    remember(certificate, problem)
    {:fail, problem}
  end

  def verify(_certificate, {:extension, _extension}, state), do: {:unknown, state}
  def verify(_certificate, :valid, state), do: {:valid, state}

  def verify(certificate, :valid_peer, state) do
    remember(certificate, nil)
    {:valid, state}
  end

  @doc "The name and the problem of the certificate that this process has seen."
  @spec seen() :: {name :: String.t() | nil, problem :: term()}
  def seen do
    {name, problem, _address} = remembered()
    {name, problem}
  end

  @doc "The address from which that certificate came (`Mesh.Distribution.ConnectionLog.Address`)."
  @spec address() :: String.t() | nil
  def address, do: elem(remembered(), 2)

  defp remember(certificate, problem),
    do: Process.put(__MODULE__, {name(certificate), problem, Address.find()})

  defp remembered, do: Process.get(__MODULE__, {nil, nil, nil})

  # The common name in an `#OTPCertificate{}`, whose records are not Elixir's.
  defp name(certificate) do
    with tbs when is_tuple(tbs) <- elem(certificate, 1),
         {:rdnSequence, sets} <- elem(tbs, 6),
         [name | _] <- for({_, {2, 5, 4, 3}, value} <- List.flatten(sets), do: text(value)) do
      name
    else
      _none -> nil
    end
  end

  defp text({_kind, text}), do: text(text)
  defp text(text) when is_binary(text) and byte_size(text) <= 64, do: text
  defp text(text) when is_list(text) and length(text) <= 64, do: to_string(text)
  defp text(_other), do: nil
end
