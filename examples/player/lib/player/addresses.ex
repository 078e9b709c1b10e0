defmodule Player.Addresses do
  @moduledoc """
  Reads the addresses of devices in Player's configuration files: `key:host:robot:interface:index`, of which all but the last two may be
  missing. The robot is the TCP port that it is served at. Pure.
  """
  alias Player.Sections

  @type t :: %{
          robot: pos_integer() | nil,
          interface: String.t(),
          index: non_neg_integer()
        }

  @doc """
  One address, or `:error`.

      iex> Player.Addresses.read("bank2:::sonar:1")
      {:ok, %{robot: nil, interface: "sonar", index: 1}}
      iex> Player.Addresses.read("6666:position2d:0")
      {:ok, %{robot: 6666, interface: "position2d", index: 0}}
      iex> Player.Addresses.read("position2d")
      :error
  """
  @spec read(term()) :: {:ok, t()} | :error
  def read(word) when is_binary(word) do
    with [index, interface | more] <- word |> String.split(":") |> Enum.reverse(),
         {index, ""} when index >= 0 <- Integer.parse(index),
         {:ok, robot} <- robot(more),
         do: {:ok, %{robot: robot, interface: interface, index: index}},
         else: (_no -> :error)
  end

  def read(_other), do: :error

  defp robot([port | _host_and_key]) when port != "" do
    case Integer.parse(port) do
      {port, ""} when port > 0 -> {:ok, port}
      _no -> :error
    end
  end

  defp robot(_none), do: {:ok, nil}

  @doc "The addresses that a section provides, in its option `provides` or, in the oldest files, by its type, such as `position:0`."
  @spec provided(Sections.section()) :: [t()]
  def provided(section) do
    case List.keyfind(section.options, "provides", 0) do
      {_name, _line, value} -> all(value)
      nil -> all(section.type)
    end
  end

  @doc "The addresses that a section requires, with the line of that option."
  @spec required(Sections.section()) :: {pos_integer(), [t()]} | nil
  def required(section) do
    with {_name, line, value} <- List.keyfind(section.options, "requires", 0),
         do: {line, all(value)}
  end

  defp all({:tuple, words}), do: for(word <- words, {:ok, address} <- [read(word)], do: address)
  defp all(word), do: all({:tuple, [word]})
end
