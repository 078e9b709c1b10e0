defmodule Swarm.Status.Row do
  @moduledoc false
  # Packs a robot's status into a row of the blackboard, for nodes that cannot reach it: small, in whole numbers (mm,
  # mrad, mm/s) and text. Pure. Which fields it has, and how each is sent, is in the table of `Swarm.Status`; `{:maybe, how}` is
  # left out where it is `nil` or says the normal case: wheels that may turn, parts that do not hang.
  alias Hal.Pose
  alias Swarm.Blackboard.Codec
  alias Swarm.Status
  alias Swarm.Status.{Frame, Sight}
  alias Swarm.Wire

  # Longer than any name: text from outside is not printed at any length.
  @words 80
  # In mm: a robot that is less certain than 100 km reports this.
  @unsure_mm 100_000_000

  @doc "A status as it is sent."
  @spec encode(Status.t()) :: map()
  def encode(%Status{} = status) do
    for {field, how} <- Status.sent(),
        {key, value} <- sent(how, field, Map.fetch!(status, field), status),
        into: %{},
        do: {key, value}
  end

  defp sent({:maybe, how}, field, value, _status) do
    case if(value == nil, do: nil, else: put(how, value)) do
      nil -> []
      value -> [{field, value}]
    end
  end

  defp sent(:view, _view, view, status) do
    {number, members} = view || {0, []}
    # Nearly always none, while it may hear many.
    deaf_to = members -- [status.robot | status.hears]
    [view: {number, texts(members)}, deaf_to: texts(deaf_to)]
  end

  # In the order of the names.
  defp sent(:offline, _health, health, %{offline: lines}) do
    devices = for {device, {:offline, _reason}} <- health, do: device
    words = if lines == %{}, do: [], else: [words: Enum.map(devices, &Map.get(lines, &1, ""))]
    [{:offline, texts(devices)} | words]
  end

  defp sent(how, field, value, _status), do: [{field, put(how, value)}]

  defp put(_how, nil), do: nil
  defp put(how, word) when how in [:name, :word], do: Atom.to_string(word)
  defp put(:words, words), do: texts(words)
  defp put(:pose, pose), do: {mm(pose.x), mm(pose.y), mm(pose.heading)}
  defp put(:thousandths, number), do: mm(number)
  defp put(:metres, metres), do: min(mm(metres), @unsure_mm)

  # An escape would reach a terminal.
  defp put({:text, most}, "" <> text) do
    text
    |> String.replace(~r/[[:cntrl:]]/u, " ")
    |> String.codepoints()
    |> Enum.take(most)
    |> Enum.join()
  end

  defp put({:text, _most}, _other), do: nil
  defp put(:arming, :disarmed), do: "disarmed"
  defp put(:arming, {:error, _reason}), do: "error"
  defp put(:arming, _armed), do: nil
  defp put(:hung, {what, where, ago_ms}), do: {Atom.to_string(what), where, ago_ms}
  defp put(:frame, frame), do: Frame.encode(frame)
  defp put(how, sight) when how in [:head, :sight], do: Sight.encode(sight)
  defp put(:sum, counts), do: counts |> Map.values() |> Enum.sum()
  defp put(how, value) when how in [:number, :count, :boolean, :age], do: value

  defp mm(number), do: round(number * 1000)
  defp texts(names), do: Enum.map(names, &Atom.to_string/1)

  @doc "The status in a row of this age; `:error` for anything else."
  @spec decode(atom(), term(), age_ms :: non_neg_integer()) :: {:ok, Status.t()} | :error
  def decode(robot, row, age_ms) when is_map(row) do
    Enum.reduce_while(Status.sent(), {:ok, %Status{robot: robot, from: :row}}, fn
      {field, how}, {:ok, status} ->
        case told(how, field, row, age_ms, robot) do
          {:ok, fields} -> {:cont, {:ok, struct!(status, fields)}}
          :error -> {:halt, :error}
        end
    end)
  end

  def decode(_robot, _other, _age_ms), do: :error

  defp told({:maybe, how}, field, row, age_ms, _robot) do
    case row do
      %{^field => value} when value != nil -> named(field, get(how, value, age_ms))
      _none -> {:ok, [{field, nil}]}
    end
  end

  defp told(:view, _view, row, _age_ms, robot) do
    with %{view: {number, members}, deaf_to: deaf_to} <- row,
         true <- Wire.number?(number) and texts?(members) and texts?(deaf_to) do
      members = names(members)
      {:ok, view: {number, members}, hears: members -- [robot | names(deaf_to)]}
    else
      _other -> :error
    end
  end

  defp told(:offline, _health, row, _age_ms, _robot) do
    words = Map.get(row, :words, [])

    with %{offline: offline} <- row,
         true <- texts?(offline) and texts?(words) do
      devices = Enum.map(offline, &Codec.word/1)

      {:ok,
       health: Map.new(devices, &{&1, {:offline, :unknown}}),
       offline: devices |> Enum.zip(words) |> Map.new()}
    else
      _other -> :error
    end
  end

  defp told(how, field, row, age_ms, _robot) do
    with {:ok, value} <- Map.fetch(row, field), do: named(field, get(how, value, age_ms))
  end

  defp named(field, {:ok, value}), do: {:ok, [{field, value}]}
  defp named(_field, :error), do: :error

  defp get(:word, nil, _age_ms), do: {:ok, nil}

  defp get(how, word, _age_ms) when how in [:name, :word],
    do: if(shown?(word, @words), do: {:ok, Codec.word(word)}, else: :error)

  defp get(:pose, nil, _age_ms), do: {:ok, nil}
  defp get(:thousandths, nil, _age_ms), do: {:ok, nil}
  defp get(:number, number, _age_ms) when number == nil or is_number(number), do: {:ok, number}
  defp get(:boolean, value, _age_ms) when is_boolean(value), do: {:ok, value}
  defp get(:arming, "disarmed", _age_ms), do: {:ok, :disarmed}
  defp get(:arming, "error", _age_ms), do: {:ok, {:error, :unknown}}
  defp get(:frame, frame, _age_ms), do: {:ok, Frame.decode(frame)}
  defp get(:head, head, _age_ms), do: {:ok, Sight.decode_head(head)}
  defp get(:sight, sight, _age_ms), do: {:ok, Sight.decode(sight)}
  defp get(:age, nil, age_ms), do: {:ok, age_ms}

  defp get(:metres, mm, _age_ms) when is_integer(mm) and mm in 0..@unsure_mm, do: {:ok, mm / 1000}

  defp get({:text, most}, text, _age_ms),
    do: if(shown?(text, most), do: {:ok, text}, else: :error)

  defp get(:hung, {what, where, ago_ms}, age_ms)
       when what in ["silent", "hung"] and is_integer(ago_ms) and ago_ms >= 0 do
    what = if what == "silent", do: :silent, else: :hung
    if shown?(where, @words), do: {:ok, {what, where, ago_ms + age_ms}}, else: :error
  end

  defp get(:words, words, _age_ms),
    do: if(texts?(words), do: {:ok, Enum.map(words, &Codec.word/1)}, else: :error)

  defp get(:pose, pose, _age_ms) do
    if Wire.pose?(pose) do
      {x, y, heading} = pose
      {:ok, Pose.new(x / 1000, y / 1000, heading / 1000)}
    else
      :error
    end
  end

  defp get(how, number, age_ms) when how in [:thousandths, :count, :sum, :age] do
    cond do
      not Wire.number?(number) -> :error
      how == :thousandths -> {:ok, number / 1000}
      how == :age -> {:ok, number + age_ms}
      how == :sum -> {:ok, if(number > 0, do: %{all: number}, else: %{})}
      true -> {:ok, number}
    end
  end

  defp get(_how, _other, _age_ms), do: :error

  defp texts?(list), do: Wire.list?(list, &shown?(&1, 3 * @words))

  # Whether it may be printed: so many characters, and no escape among them.
  defp shown?(text, most) do
    is_binary(text) and byte_size(text) <= 4 * most and String.printable?(text) and
      not (text =~ ~r/[[:cntrl:]]/u)
  end

  defp names(texts), do: for(text <- texts, {:ok, name} <- [Codec.robot(text)], do: name)
end
