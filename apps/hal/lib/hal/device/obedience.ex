defmodule Hal.Device.Obedience do
  @moduledoc """
  Decides whether a device does what it is told. Pure, integer milliseconds; `Hal.Device` calls it.
  A device that answers, and obeys nothing, is of no more use than one that is silent.

  | what | then |
  |---|---|
  | a driver reports `{:refused, request, line}` | it is counted, and told when it is the first in a row, and every 10 s |
  | 3 such in a row of one request, over 2 s at least | offline, until `{:obeyed, request}` or, for `:look` and `:drive`, until the device moves |
  | a head stands still more than 5 degrees from where it is told to look, for 5 s | offline, until it moves |
  | wheels stand still, told to do 0.1 m/s or 0.3 rad/s at least, for 3 s | offline, until they turn; disarmed, if a person arms them |

  A head whose reach is not known (`c:Hal.Ptz.reach/1`) is judged by where it stands only until it
  has moved for the first time: later it may be at its end.
  """
  alias Hal.{Odometry, Pose, Twist}

  @row 3
  @row_ms 2_000
  @again_ms 10_000

  @far 5 * :math.pi() / 180
  @moved 1 * :math.pi() / 180
  @head_ms 5_000

  @told_linear 0.1
  @told_turn 0.3
  @moved_m 0.01
  @moved_turn 0.02
  @wheels_ms 3_000

  defstruct refusals: %{}, wanted: nil, stood: nil, moved?: false, stuck?: false, late?: false

  @type request :: :look | :zoom | :drive | atom()
  @type refusal :: %{
          count: pos_integer(),
          row: non_neg_integer(),
          since_ms: integer(),
          told_ms: integer(),
          last_ms: integer(),
          line: String.t()
        }
  @typedoc """
  `wanted` is where a head is to look, or the speed that the wheels were given; `stood` where the
  device stands since when, while it should move. It is `late?` while that has lasted too long, and `stuck?` from then on, until
  it moves.
  """
  @type t :: %__MODULE__{
          refusals: %{request() => refusal()},
          wanted: {pan :: float(), tilt :: float()} | Twist.t() | nil,
          stood: {place :: term(), since_ms :: integer()} | nil,
          moved?: boolean(),
          stuck?: boolean(),
          late?: boolean()
        }
  @typedoc "The ranges of a head, in radians, `{least, greatest}` each; `nil` if they are not known."
  @type reach :: {pan :: {float(), float()}, tilt :: {float(), float()}} | nil
  @type fault :: {:refuses, request(), line :: String.t()} | {:stands, :head | :wheels}

  @doc "A device of which nothing is known yet."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "Its driver was opened again: what it refused counts on, the rest begins anew."
  @spec opened(t()) :: t()
  def opened(%__MODULE__{refusals: refusals}),
    do: %__MODULE__{refusals: Map.new(refusals, fn {what, r} -> {what, %{r | row: 0}} end)}

  @doc """
  Takes what the device was told: a direction (radians) of a head, or a speed of wheels. A value that is not a speed counts as a
  stop, as it does in the driver.
  """
  @spec told(t(), {float(), float()} | Twist.t()) :: t()
  def told(%__MODULE__{} = obedience, %Twist{linear: linear, turn: turn})
      when not is_float(linear) or not is_float(turn),
      do: %{obedience | wanted: Twist.zero()}

  def told(%__MODULE__{} = obedience, wanted), do: %{obedience | wanted: wanted}

  @doc """
  Takes readings; returns those that are not about obedience, and the requests whose refusal is to
  be told now.

      iex> alias Hal.Device.Obedience
      iex> {readings, told, obedience} = Obedience.heard(Obedience.new(), [{:refused, :zoom, "no lens"}, :other], nil, 0)
      iex> {readings, told, obedience.refusals.zoom.count}
      {[:other], [:zoom], 1}
      iex> {[], told, obedience} = Obedience.heard(obedience, [{:refused, :zoom, "no lens"}], nil, 900)
      iex> {told, obedience.refusals.zoom.count}
      {[], 2}
  """
  @spec heard(t(), [term()], reach(), integer()) :: {[term()], [request()], t()}
  def heard(%__MODULE__{} = obedience, readings, reach, at_ms) do
    {rest, told, obedience} =
      Enum.reduce(readings, {[], [], obedience}, fn reading, {rest, told, obedience} ->
        case reading do
          {:refused, request, line} when is_atom(request) and is_binary(line) ->
            {now?, obedience} = refused(obedience, request, line, at_ms)
            {rest, if(now?, do: [request | told], else: told), obedience}

          {:obeyed, request} when is_atom(request) ->
            {rest, told, obeyed(obedience, request)}

          reading ->
            {[reading | rest], told, seen(obedience, reading, reach, at_ms)}
        end
      end)

    {Enum.reverse(rest), Enum.reverse(told), obedience}
  end

  defp refused(obedience, request, line, at_ms) do
    {now?, refusal} =
      case obedience.refusals do
        %{^request => %{row: row} = r} when row > 0 ->
          now? = at_ms - r.told_ms >= @again_ms
          r = %{r | count: r.count + 1, row: row + 1, last_ms: at_ms, line: line}
          {now?, if(now?, do: %{r | told_ms: at_ms}, else: r)}

        others ->
          count = (others[request][:count] || 0) + 1
          times = %{since_ms: at_ms, told_ms: at_ms, last_ms: at_ms}
          {true, Map.merge(times, %{count: count, row: 1, line: line})}
      end

    {now?, %{obedience | refusals: Map.put(obedience.refusals, request, refusal)}}
  end

  defp obeyed(%{refusals: refusals} = obedience, request) when is_map_key(refusals, request),
    do: put_in(obedience.refusals[request].row, 0)

  defp obeyed(obedience, _request), do: obedience

  # Where it stands

  defp seen(%{wanted: wanted} = obedience, {:ptz, %{pan: pan, tilt: tilt}}, reach, at_ms)
       when not is_struct(wanted) do
    place = {pan, tilt}
    due? = (reach != nil or not obedience.moved?) and far?(wanted, place, reach)
    stand(obedience, :look, place, due?, &turned?(&1, place), {@head_ms, at_ms})
  end

  defp seen(obedience, {:odometry, %Odometry{pose: pose, twist: twist}}, _reach, at_ms) do
    turns? = abs(twist.linear) >= @moved_m or abs(twist.turn) >= @moved_turn
    moved? = &(turns? or went?(&1, pose))
    stand(obedience, :drive, pose, fast?(obedience.wanted), moved?, {@wheels_ms, at_ms})
  end

  defp seen(obedience, _other, _reach, _at_ms), do: obedience

  defp stand(%{stood: nil} = obedience, _request, place, _due?, _moved?, {_limit, at_ms}),
    do: %{obedience | stood: {place, at_ms}}

  defp stand(%{stood: {from, since_ms}} = obedience, request, place, due?, moved?, {limit, at_ms}) do
    cond do
      moved?.(from) ->
        obedience = obeyed(obedience, request)
        %{obedience | stood: {place, at_ms}, moved?: true, stuck?: false, late?: false}

      not due? ->
        %{obedience | stood: {from, at_ms}, late?: false}

      true ->
        late? = at_ms - since_ms >= limit
        %{obedience | stuck?: obedience.stuck? or late?, late?: late?}
    end
  end

  defp far?(nil, _place, _reach), do: false

  defp far?({pan, tilt}, {p, t}, reach) do
    {pans, tilts} = reach || {nil, nil}
    abs(within(pan, pans) - p) > @far or abs(within(tilt, tilts) - t) > @far
  end

  defp within(angle, nil), do: angle
  defp within(angle, {least, greatest}), do: angle |> max(least) |> min(greatest)

  defp turned?({pan, tilt}, {p, t}), do: abs(p - pan) > @moved or abs(t - tilt) > @moved

  defp went?(%Pose{} = from, %Pose{} = to) do
    abs(to.x - from.x) > @moved_m or abs(to.y - from.y) > @moved_m or
      abs(to.heading - from.heading) > @moved_turn
  end

  defp fast?(%Twist{linear: linear, turn: turn}),
    do: abs(linear) >= @told_linear or abs(turn) >= @told_turn

  defp fast?(_nothing), do: false

  @doc """
  Whether the device obeys; the error says what it does not do.

      iex> alias Hal.Device.Obedience
      iex> head = {:ptz, %{pan: 0.0, tilt: 0.0, field_of_view: 0.8}}
      iex> told = Obedience.told(Obedience.new(), {1.0, 0.0})
      iex> stands = Enum.reduce([0, 2_000, 5_000], told, fn at_ms, o -> elem(Obedience.heard(o, [head], nil, at_ms), 2) end)
      iex> Obedience.judge(stands, :ptz)
      {:error, {:stands, :head}}
      iex> {_, _, turned} = Obedience.heard(stands, [put_elem(head, 1, %{pan: 0.3, tilt: 0.0, field_of_view: 0.8})], nil, 5_100)
      iex> Obedience.judge(turned, :ptz)
      :ok
  """
  @spec judge(t(), Hal.Device.kind()) :: :ok | {:error, fault()}
  def judge(%__MODULE__{refusals: refusals} = obedience, kind) do
    refusal =
      Enum.find(refusals, fn {_request, r} ->
        r.row >= @row and r.last_ms - r.since_ms >= @row_ms
      end)

    case refusal do
      {request, %{line: line}} -> {:error, {:refuses, request, line}}
      nil when not obedience.stuck? -> :ok
      nil when kind == :drive -> {:error, {:stands, :wheels}}
      nil -> {:error, {:stands, :head}}
    end
  end
end
