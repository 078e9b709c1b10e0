defmodule Swarm.Discovery.Search do
  @moduledoc false
  # Finds the robots that match (`Swarm.find/1`): templates over `Swarm.Discovery.RobotInfo`.
  alias Hal.Options.Suggest
  alias Swarm.Transport
  alias Swarm.Discovery.RobotInfo

  @max_age_ms 10_000
  @keys [:robot, :node, :profile, :battery, :calibrated, :mission, :state, :service, :max_age_ms]

  @doc "The robots that are present and match, sorted, or one line about a bad option."
  @spec robots(term()) :: [atom()] | {:error, line :: String.t()}
  def robots(template) do
    with :ok <- keyword(template),
         nil <- Enum.find_value(template, &wrong/1) do
      {max_age_ms, template} = Keyword.pop(template, :max_age_ms, @max_age_ms)

      for robot <- Transport.robots(),
          template == [] or like?(RobotInfo.of(robot, max_age_ms), template),
          do: robot
    else
      line when is_binary(line) -> {:error, line}
    end
  end

  @doc """
  Whether a robot matches.

      iex> about = %Swarm.Discovery.RobotInfo{robot: :mag1, profile: :magellan, battery: 12.1, services: [:camera]}
      iex> Swarm.Discovery.Search.like?({:ok, about}, service: :camera, battery: {11.5, 14})
      true
      iex> Swarm.Discovery.Search.like?({:ok, about}, battery: &(&1 > 13))
      false
  """
  @spec like?({:ok, RobotInfo.t()} | :error, keyword()) :: boolean()
  def like?({:ok, about}, template), do: Enum.all?(template, &as_wanted?(about, &1))
  def like?(:error, _template), do: false

  defp as_wanted?(about, {:service, wanted}), do: Enum.any?(about.services, &fits?(&1, wanted))
  defp as_wanted?(about, {key, wanted}), do: about |> Map.fetch!(key) |> fits?(wanted)

  # A robot of which nothing is known does not match, unless that is what is wanted.
  defp fits?(nil, wanted), do: wanted == nil
  defp fits?(value, wanted) when is_function(wanted), do: !!wanted.(value)
  defp fits?(value, %Range{} = range), do: fits?(value, Enum.min_max(range))
  defp fits?(value, {low, high}), do: is_number(value) and value >= low and value <= high
  defp fits?(value, wanted) when is_list(wanted), do: Enum.any?(wanted, &fits?(value, &1))
  defp fits?(value, wanted) when is_number(wanted), do: value == wanted
  # What travelled as text stays text if this node has no such atom.
  defp fits?(value, wanted), do: to_string(value) == to_string(wanted)

  defp keyword(template) do
    if Keyword.keyword?(template),
      do: :ok,
      else: "#{inspect(template)} does not describe a robot; write for example service: :camera"
  end

  defp wrong({key, _wanted}) when key not in @keys do
    names = Enum.map(@keys, &Atom.to_string/1)
    hint = Suggest.hint(Atom.to_string(key), names)
    "robots cannot be found by #{inspect(key)}: allowed are #{Enum.join(names, ", ")}#{hint}"
  end

  defp wrong({key, wanted}) do
    unless allowed?(key, wanted), do: "#{key}: expected #{allowed(key)}, got #{inspect(wanted)}"
  end

  defp allowed?(:max_age_ms, ms), do: ms == :infinity or (is_integer(ms) and ms >= 0)
  defp allowed?(_key, wanted) when is_function(wanted, 1), do: true
  defp allowed?(:calibrated, wanted), do: is_boolean(wanted)
  defp allowed?(:battery, %Range{first: first, last: last, step: 1}), do: first <= last
  defp allowed?(:battery, {low, high}), do: is_number(low) and is_number(high)
  defp allowed?(:battery, wanted), do: is_number(wanted) or wanted == nil

  defp allowed?(_name, wanted) when is_list(wanted),
    do: not List.improper?(wanted) and Enum.all?(wanted, &word?/1)

  defp allowed?(_name, wanted), do: word?(wanted)

  defp word?(word), do: is_atom(word) or (is_binary(word) and String.valid?(word))

  defp allowed(:max_age_ms), do: "milliseconds or :infinity"
  defp allowed(:calibrated), do: "true, false or a function"
  defp allowed(:battery), do: "volts, {24.0, 28.0}, 24..28 or a function"
  defp allowed(_name), do: "a name, a list of names or a function"
end
