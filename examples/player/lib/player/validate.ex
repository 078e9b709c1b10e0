defmodule Player.Validate do
  @moduledoc """
  Leaves out what Player's file can say but a robot file cannot: checks each imported value
  against the schema of robot files and against its driver. Pure, except that it looks up drivers.
  """
  alias Hal.Options.Type
  alias Robot.File.{Body, Device}

  @least %{drive: [port: "/dev/null"], ptz: [port: "/dev/null"], camera: [source: "/dev/video0"]}

  @doc "Keeps only values that are allowed one by one; `modules` are the drivers by kind."
  @spec allowed(Player.State.t(), %{atom() => module()}) :: Player.State.t()
  def allowed(state, modules) do
    for {path, value, _line, _option} = entry <- state.values,
        why = refused(path, value, modules),
        reduce: state do
      state -> Player.State.leave(state, &(&1 == entry), why)
    end
  end

  defp refused([:body | keys], value, _modules) do
    check = Enum.reduce(keys, Body.type(), &key/2)

    case Type.read(check, plain(value)) do
      {:ok, _value} -> nil
      {:error, [{_path, text} | _more]} -> text
    end
  end

  # Checked alone, so without conditions that only other values of its kind fulfil.
  defp refused([kind | path], value, modules) when is_map_key(@least, kind) do
    options = Keyword.merge(@least[kind], nest(path, plain(value)))

    if Code.ensure_loaded?(modules[kind]), do: Device.refused_by(modules[kind], options)
  end

  defp refused(_path, _value, _modules), do: nil

  defp key(key, {:keys, table}), do: table[key]
  defp key(key, {:or, nil, type}), do: key(key, type)

  # The bounds of a time that is assembled later are not options; segments are checked with their
  # count.
  defp nest([:sonar_times, _name], _us), do: []
  defp nest([:bumpers, :segments], _segments), do: []
  defp nest([key], value), do: [{key, value}]
  defp nest([key | path], value), do: [{key, nest(path, value)}]

  defp plain({:deg, degrees}), do: degrees * :math.pi() / 180

  defp plain(tuple) when is_tuple(tuple),
    do: tuple |> Tuple.to_list() |> Enum.map(&plain/1) |> List.to_tuple()

  defp plain(list) when is_list(list), do: Enum.map(list, &plain/1)
  defp plain(value), do: value
end
