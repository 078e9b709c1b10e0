defmodule Lab.Scenario.Text do
  @moduledoc "Writes values of a scenario as text, as a person would. Pure."

  @doc """
  An entry of a script or an expectation. Numbers that are whole are written so: they are read as
  floats again.

      iex> Lab.Scenario.Text.form({:at, :mag1, {2.0, 0.5}, [within_m: 0.1, by_s: 30.0]})
      "{:at, :mag1, {2, 0.5}, within_m: 0.1, by_s: 30}"
  """
  @spec form(term()) :: String.t()
  def form(value), do: value(value, &number/1)

  @doc """
  An option's value, with its numbers as they are. What looks like keys is written so unless one stands there twice, which
  no file may say.

      iex> Lab.Scenario.Text.option([{{3.0, 2}, 40}])
      "[{{3.0, 2}, 40}]"
      iex> for kills <- [[mag1: 9, leader: 30], [leader: 9, leader: 30]], do: Lab.Scenario.Text.option(kills)
      ["[mag1: 9, leader: 30]", "[{:leader, 9}, {:leader, 30}]"]
  """
  @spec option(term()) :: String.t()
  def option(value), do: value(value, &inspect/1)

  defp value(number, show) when is_number(number), do: show.(number)

  defp value(tuple, show) when is_tuple(tuple) do
    {values, keys} =
      case tuple |> Tuple.to_list() |> Enum.split(-1) do
        {values, [[_ | _] = last]} ->
          if keys?(last), do: {values, last}, else: {values ++ [last], []}

        {values, last} ->
          {values ++ last, []}
      end

    "{" <> Enum.join(Enum.map(values, &value(&1, show)) ++ keys(keys, show), ", ") <> "}"
  end

  defp value([_ | _] = list, show) do
    if keys?(list),
      do: "[" <> Enum.join(keys(list, show), ", ") <> "]",
      else: "[" <> Enum.map_join(list, ", ", &value(&1, show)) <> "]"
  end

  defp value(text, _show) when is_binary(text),
    do: inspect(text, printable_limit: :infinity, limit: :infinity)

  defp value(other, _show), do: inspect(other)

  defp keys?(list) do
    Keyword.keyword?(list) and Keyword.keys(list) == Enum.uniq(Keyword.keys(list))
  end

  # The reader tells `{a, [{:b, 1}]}` from keys by how they are written, and takes both.
  defp keys(keys, show), do: for({key, value} <- keys, do: "#{key}: #{value(value, show)}")

  defp number(float) when is_float(float) and float == trunc(float), do: inspect(trunc(float))
  defp number(number), do: inspect(number)
end
