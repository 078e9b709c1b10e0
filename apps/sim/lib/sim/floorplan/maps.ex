defmodule Sim.Floorplan.Maps do
  @moduledoc "Lists the built-in maps by name. Pure."
  alias Hal.Options.Suggest
  alias Sim.Floorplan.Maps.{Corridors, Halls, Partitions, Rough, Wide}

  @picture "FILE.png:WIDTHxHEIGHT or FILE.pgm:WIDTHxHEIGHT"

  @maps [
    {"hall", Halls, "one empty room, larger for larger fleets"},
    {"hospital", Halls, "a large room, a corridor around it, and wards along the corridor"},
    {"arena", Halls, "a square with a circle of pillars"},
    {"clinic", Corridors, "two wings across a main corridor, wards with beds, a lobby"},
    {"offices", Corridors, "thirteen rooms with desks along a corridor"},
    {"openplan", Wide, "one room with pillars, desks and a booth"},
    {"lab", Rough, "a room with diagonal walls and benches"},
    {"cave", Rough, "six chambers without a straight wall"},
    {"ring", Wide, "a round corridor; the centre is wall"},
    {"doorway", Corridors, "two rooms and a door of 0.9 m"},
    {"rooms", Partitions, "rooms and doors at random; rooms:7 is another building"}
  ]

  @seeds 0..4_294_967_295

  @doc """
  Their names, and what each shows in a few words.

      iex> {"hall", about} = hd(Sim.Floorplan.Maps.list())
      iex> about
      "one empty room, larger for larger fleets"
  """
  @spec list() :: [{String.t(), about :: String.t()}]
  def list, do: for({name, _module, about} <- @maps, do: {name, about})

  @doc """
  Their names.

      iex> Enum.join(Sim.Floorplan.Maps.names(), " ")
      "hall hospital arena clinic offices openplan lab cave ring doorway rooms"
  """
  @spec names() :: [String.t()]
  def names, do: for({name, _module, _about} <- @maps, do: name)

  @doc """
  Whether one of them has this name.

      iex> for name <- ["hall", "rooms", "rooms:7", "rooms:-1", "hall:7"], do: Sim.Floorplan.Maps.built_in?(name)
      [true, true, true, false, false]
  """
  @spec built_in?(String.t()) :: boolean()
  def built_in?("rooms:" <> seed), do: seed?(seed)
  def built_in?(name), do: List.keymember?(@maps, name, 0)

  defp seed?(text), do: match?({seed, ""} when seed in @seeds, Integer.parse(text))

  @doc "What a map may be, in words."
  @spec allowed() :: String.t()
  def allowed, do: Enum.join(names(), ", ") <> ", FILE.yaml, #{@picture}"

  @doc """
  What is wrong with the name of a map: what is allowed there, and more about it.

      iex> Sim.Floorplan.Maps.fault("floor.png")
      {"FILE.png:WIDTHxHEIGHT or FILE.pgm:WIDTHxHEIGHT in metres, such as floor.png:16x12,", "; its size is missing"}
      iex> Sim.Floorplan.Maps.fault("floor.png:16,12")
      {"FILE.png:WIDTHxHEIGHT or FILE.pgm:WIDTHxHEIGHT in metres, such as floor.png:16x12,", "; 16,12 is not a size"}
      iex> {_allowed, hint} = Sim.Floorplan.Maps.fault("floor.jpg")
      iex> hint
      "; .jpg is not read: save the picture as PNG"
      iex> {_allowed, hint} = Sim.Floorplan.Maps.fault("ofices")
      iex> hint
      "; did you mean offices?"
  """
  @spec fault(String.t()) :: {allowed :: String.t(), hint :: String.t()}
  def fault(name) do
    {file, size} = parts(name)
    %{first: first, last: last} = @seeds
    kind = file |> Path.extname() |> String.downcase()

    cond do
      file == "rooms" -> {"rooms:SEED, a whole number from #{first} to #{last},", ""}
      kind in [".png", ".pgm", ".bmp"] and size == nil -> {sized(file), "; its size is missing"}
      kind in [".png", ".pgm", ".bmp"] -> {sized(file), "; #{size} is not a size"}
      kind in [".yaml", ".yml"] -> {"FILE.yaml", "; its description says how large the map is"}
      kind != "" -> {"FILE.yaml, #{@picture}", "; #{kind} is not read: save the picture as PNG"}
      true -> {allowed(), Suggest.hint(name, names())}
    end
  end

  defp parts(name) do
    case name |> String.split(":") |> Enum.split(-1) do
      {[], [file]} -> {file, nil}
      {file, [size]} -> {Enum.join(file, ":"), size}
    end
  end

  defp sized(file), do: "#{@picture} in metres, such as #{Path.basename(file)}:16x12,"

  @doc "The fields of the map of this name for a fleet of this size; `nil` if there is none."
  @spec draw(String.t(), pos_integer()) :: map() | nil
  def draw("rooms:" <> seed = name, fleet),
    do: if(seed?(seed), do: Partitions.draw(name, fleet))

  def draw(name, fleet) do
    with {^name, module, _about} <- List.keyfind(@maps, name, 0), do: module.draw(name, fleet)
  end
end
