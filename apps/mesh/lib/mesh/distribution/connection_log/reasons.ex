defmodule Mesh.Distribution.ConnectionLog.Reasons do
  @moduledoc false
  # Interprets Erlang's reports of refused connections. Pure.

  @fatal 2
  # Alerts of TLS (RFC 8446, section 6) that a refused node gets or sends.
  @alerts %{
    10 => "it does not speak TLS",
    22 => "it does not speak TLS",
    40 => "no agreement on how to speak TLS",
    42 => "its certificate is bad",
    43 => "its certificate is of a wrong kind",
    44 => "its certificate is revoked",
    45 => "its certificate is out of date, or a clock is wrong",
    46 => "its certificate is not known",
    48 => "its certificate is of another fleet (unknown CA)",
    50 => "it does not speak TLS",
    51 => "its certificate is not signed as it should be",
    70 => "it speaks another TLS",
    116 => "it has no certificate"
  }

  @type message :: {:report, term()} | {:string, term()} | {:io.format(), [term()]}

  @doc """
  Which side was refused, they or us, the peer, if known, and the reason; `:known` for what was
  already reported in another form; `:ignore` for everything that is not a refusal.

      iex> Mesh.Distribution.ConnectionLog.Reasons.read({~c"** Connection attempt from node ~w rejected. Invalid challenge reply. **~n", [:spy@lab]}, {nil, nil})
      {:them, "spy@lab", "wrong cookie: another secret"}
  """
  @spec read(message(), seen :: {String.t() | nil, term()}) ::
          {:them | :us, who :: String.t() | nil, why :: String.t()} | :known | :ignore
  def read({:report, %{alert: alert, alerter: alerter, protocol: ~c"TLS"}}, seen),
    do: alert(alert, alerter, seen)

  def read({:report, %{alert: alert, alerter: alerter, protocol: "TLS"}}, seen),
    do: alert(alert, alerter, seen)

  def read({:report, %{label: {:error_logger, _tag}, format: format, args: arguments}}, seen),
    do: read({format, arguments}, seen)

  def read({[?* | _] = format, [who | _]}, _seen), do: format |> List.to_string() |> said(who)
  def read({~c"TLS distribution handshake failed" ++ _rest, _arguments}, _seen), do: :known
  def read(_message, _seen), do: :ignore

  defp alert({:alert, @fatal, code, _where, _role, reason}, alerter, {name, problem}) do
    why = Map.get(@alerts, code, "TLS alert #{code}")

    if alerter == :peer,
      do: {:us, name, ours(why)},
      else: {:them, name, own(why, problem, reason)}
  end

  defp alert(_warning, _alerter, _seen), do: :ignore

  defp own(why, nil, _reason), do: why
  defp own(why, {:bad_cert, :unknown_ca}, _reason), do: why
  defp own(why, {:bad_cert, problem}, _reason), do: "#{why} (#{inspect(problem, limit: 5)})"
  defp own(why, _other, _reason), do: why

  # The reason seen from our side.
  defp ours("its" <> rest), do: "our" <> rest
  defp ours("it has" <> rest), do: "we have" <> rest
  defp ours("it does" <> rest), do: "we do" <> rest
  defp ours(why), do: why

  defp said(format, who) do
    cond do
      format =~ "Invalid challenge reply" ->
        {:them, text(who), "wrong cookie: another secret"}

      format =~ "Invalid challenge ack" ->
        {:them, text(who), "wrong cookie at its end: another secret"}

      format =~ "from disallowed node" ->
        {:them, text(who), "not one of the fleet's names"}

      format =~ "from disallowed IP" ->
        {:them, text(who), "not of this network"}

      true ->
        :ignore
    end
  end

  defp text(who) when is_atom(who), do: Atom.to_string(who)
  defp text(who), do: inspect(who, limit: 50, printable_limit: 100)
end
