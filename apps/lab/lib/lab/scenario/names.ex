defmodule Lab.Scenario.Names do
  @moduledoc false
  # Lists the names that robots of a scenario may have: those of numbered fleets of each body that comes along, such as `mag1`
  # to `mag100` and `create2_1` to `create2_100`, which this module holds, so that a file that names one makes no atom; and any
  # other that a file lists as text. Pure.

  alias Hal.RobotName
  alias Robot.File.Bodies

  @most 100
  @all for kind <- Bodies.names([]), name <- RobotName.numbered(kind, @most), do: name

  @doc "All names of numbered fleets."
  @spec all() :: [atom()]
  def all, do: RobotName.usual() ++ (@all -- RobotName.usual())

  @doc """
  A fleet of `count` robots, half of each kind, one more Magellan when the count is odd.

      iex> Lab.Scenario.Names.fleet(3)
      [:mag1, :mag2, :min1]
  """
  @spec fleet(1..100) :: [atom()]
  def fleet(count) when count in 1..@most do
    mini = div(count, 2)
    RobotName.numbered("mag", count - mini) ++ RobotName.numbered("min", mini)
  end

  @doc """
  The robots of a number or a list of names; `false` if it is neither. A name that is text may be any.

      iex> {Lab.Scenario.Names.read(2), Lab.Scenario.Names.read([:min7, "rex"]), Lab.Scenario.Names.read([:dog])}
      {{:ok, [:mag1, :min1]}, {:ok, [:min7, :rex]}, false}
  """
  @spec read(term()) :: {:ok, [atom()]} | false
  def read(count) when count in 1..@most, do: {:ok, fleet(count)}

  def read([_ | _] = names) do
    with false <- List.improper?(names),
         true <- length(names) <= @most,
         {:ok, names} <- each(names, []),
         true <- names == Enum.uniq(names),
         do: {:ok, names},
         else: (_no -> false)
  end

  def read(_other), do: false

  defp each([], read), do: {:ok, Enum.reverse(read)}

  defp each([text | rest], read) when is_binary(text),
    do: with({:ok, name} <- RobotName.read(text), do: each(rest, [name | read]))

  defp each([name | rest], read),
    do: if(name in all(), do: each(rest, [name | read]), else: :error)

  @doc "Makes known the names that a file's tree (`Robot.File.Reader`) lists as text, at most #{@most}: its script may name them."
  @spec know(Robot.File.Reader.tree()) :: :ok
  def know({_line, {:keys, keys}}) do
    with {"robots", _key, {_at, {:list, nodes}}} <- List.keyfind(keys, "robots", 0),
         do:
           for(
             {_at, text} when is_binary(text) <- Enum.take(nodes, @most),
             do: RobotName.read(text)
           )

    :ok
  end

  def know(_other), do: :ok
end
