defmodule Swarm.Message.Words do
  @moduledoc "Says to people what a message between robots says. Pure."
  alias Robot.Mission.{Claim, Letter}
  alias Swarm.Agreement.Round
  alias Swarm.Message

  # Characters; what a mission sends may have 8 kB.
  @most 160

  @doc """
  A message in words, its sender and its addressees left out.

      iex> letter = %Swarm.Agreement.Round.Letter{id: {3, 1, :mag1}, view: [:mag1, :mag2], remaining_ms: 900, purpose: :search, report: :busy}
      iex> message = Swarm.Message.new(:mag2, :round, letter)
      iex> Swarm.Message.Words.of(message)
      "search 3.1 of mag1, 2 robots: busy"
      iex> {:ok, relay} = Swarm.Message.pass_on(message, :min1)
      iex> Swarm.Message.Words.of(relay)
      "round by mag2: search 3.1 of mag1, 2 robots: busy"
  """
  @spec of(Message.t()) :: String.t()
  def of(%Message{kind: kind, body: body}), do: kind |> said(body) |> short()

  defp said(:round, %Round.Letter{id: {epoch, counter, initiator}} = letter) do
    parts =
      [
        letter.report == :busy && "busy",
        letter.report not in [nil, :busy] && "its report",
        letter.known && "all reports",
        letter.digest && "final",
        letter.ask && "asks for all reports"
      ]
      |> Enum.filter(& &1)

    "#{letter.purpose} #{epoch}.#{counter} of #{initiator}, #{length(letter.view)} robots: " <>
      if(parts == [], do: "begins", else: Enum.join(parts, ", "))
  end

  defp said(:mission, %Letter{kind: kind, fields: fields}) do
    Enum.join([kind | for({key, value} <- fields, do: "#{key} #{word(value)}")], ", ")
  end

  # Numbers change all the time, and what they say is in the scene.
  defp said(:claim, %Claim{fields: fields}) do
    fields =
      for {key, value} <- Enum.sort(Map.from_struct(fields)),
          value not in [nil, false, []],
          do: {key, value}

    Enum.map_join(fields, ", ", fn
      {key, value} when is_binary(value) or (is_atom(value) and value != true) ->
        "#{key} #{value}"

      {key, _value} ->
        "#{key}"
    end)
  end

  defp said(:relay, %Message{from: from, kind: kind, body: body}),
    do: "#{kind} by #{from}: #{said(kind, body)}"

  defp said(:heartbeat, _body), do: ""

  defp word(value) when is_binary(value) or is_atom(value), do: "#{value}"
  defp word(value), do: inspect(value, limit: 12)

  defp short(text) do
    if String.length(text) > @most, do: String.slice(text, 0, @most - 1) <> "…", else: text
  end
end
