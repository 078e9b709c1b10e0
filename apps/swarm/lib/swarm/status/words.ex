defmodule Swarm.Status.Words do
  @moduledoc "Says to people what is in the fields of a `Swarm.Status`. Pure."
  alias Swarm.Status
  alias Swarm.Status.Sight

  # At most so many robots that it does not hear are named.
  @named 3

  @doc """
  What a field of a status says to people, as its line does; `nil` for nothing.

      iex> status = %Swarm.Status{robot: :mag1, blocked_by: "mag2", rejected: %{junk: 3}}
      iex> for field <- [:blocked_by, :rejected, :estop], do: Swarm.Status.Words.of(field, status)
      ["BLOCKED by mag2", "dropped 3 messages", nil]
  """
  @spec of(atom(), Status.t()) :: String.t() | nil
  def of(:estop, %{estop: true, estop_by: []}), do: "E-STOP"

  def of(:estop, %{estop: true, estop_by: callers}),
    do: "E-STOP by #{Enum.join(callers, ", ")}"

  def of(:estop_file, %{estop_file: nil}), do: nil
  def of(:estop_file, %{estop: true, estop_file: why}), do: "E-STOP NOT ON ITS DISK (#{why})"
  def of(:estop_file, %{estop_file: why}), do: "RESET NOT ON ITS DISK (#{why})"
  def of(:arming, status), do: Status.arming(status)
  def of(:fault, %{fault: why}) when why != nil, do: "FAULT (#{why})"

  def of(:limits, %{limits: limits}) do
    limits = Enum.map(limits, &to_string/1)

    words =
      if("blind" in limits, do: ["BLIND (no sonar; slow)"], else: []) ++
        if("caution" in limits, do: ["CAUTIOUS (another robot may be near; slow)"], else: [])

    if words != [], do: Enum.join(words, ", ")
  end

  def of(:hung, %{hung: {:silent, where, _ago_ms}}), do: "HANGS in #{where}"

  def of(:hung, %{hung: {:hung, where, ago_ms}}),
    do: "HUNG in #{where} #{div(ago_ms, 1_000)} s ago, started again"

  def of(:crashed, %{crashed: line}) when line != nil, do: "CRASHED #{line}"
  def of(:blocked_by, %{blocked_by: what}) when what != nil, do: "BLOCKED by #{what}"
  def of(:says, %{says: words}) when is_binary(words), do: words
  def of(:replaced, %{replaced: words}), do: words
  def of(:leader, %{leader: leader}) when leader != nil, do: "leader #{leader}"
  def of(:view, %{view: {number, _members}}), do: "view #{number}"
  def of(:hears, status), do: "hears #{length(status.hears)}" <> deaf(status)
  def of(:network, %{network: why}) when why != nil, do: "NO NETWORK (#{why})"

  def of(:rejected, %{rejected: rejected}) do
    dropped = rejected |> Map.values() |> Enum.sum()
    if dropped > 0, do: "dropped #{dropped} messages"
  end

  def of(:age_ms, %{age_ms: age_ms, from: from}),
    do: "age #{age_ms || "?"} ms" <> if(from == :row, do: " by its row", else: "")

  def of(:head, %{head: head}), do: Sight.words(head)
  def of(:sees, %{sees: sight}), do: Sight.words(sight)

  def of(:health, %{health: health, offline: lines}) do
    words =
      for {device, {:offline, _reason}} <- health do
        case lines do
          %{^device => line} -> "#{device} offline (#{line})"
          _not_told -> "#{device} offline"
        end
      end

    if words != [], do: Enum.join(words, ", ")
  end

  def of(_other, _status), do: nil

  # The robots of the view that are known only by way of others; nearly always none.
  defp deaf(%{view: {_number, members}} = status) do
    case Enum.split(members -- [status.robot | status.hears], @named) do
      {[], []} -> ""
      {names, []} -> " but not #{Enum.join(names, " ")}"
      {names, more} -> " but not #{Enum.join(names, " ")} and #{length(more)} more"
    end
  end

  defp deaf(_unknown), do: ""

  @doc "All that its fields say, in the order of the line."
  @spec all(Status.t()) :: [String.t()]
  def all(status), do: for(name <- Status.fields(), words = of(name, status), do: words)

  defimpl Inspect, for: Swarm.Status do
    def inspect(status, _options) do
      [first | rest] = [speed(status) | Swarm.Status.Words.all(status)]
      words = ["#{status.robot} #{status.state} #{place(status)} #{first}" | rest]
      "#" <> Enum.join(words, ", ")
    end

    defp place(%{pose: nil}), do: "(pose unknown)"

    defp place(%{pose: %{x: x, y: y, heading: heading}, uncertainty: metres}) do
      degrees = round(heading * 180 / :math.pi())

      "(#{fixed(x)}, #{fixed(y)}, #{degrees} deg)" <>
        if(metres, do: " ±#{fixed(metres)} m,", else: "")
    end

    defp speed(%{speed: nil}), do: "speed unknown"

    defp speed(status),
      do: "#{fixed(status.speed)} m/s" <> if(status.by, do: " by #{status.by}", else: "")

    defp fixed(number), do: :erlang.float_to_binary(number * 1.0, decimals: 2)
  end
end
