defmodule Console.Cli.MapName do
  @moduledoc "Reads a map on a command line: a built-in one by name, a description, or a picture with its size. Pure."
  alias Hal.Cli.Parse
  alias Sim.Floorplan.Maps

  @doc """
  The map as `Sim.Floorplan.open/2` takes it; a file is relative to `folder`.

      iex> Console.Cli.MapName.parse("floor.png:16x12", "/maps")
      {:ok, "/maps/floor.png:16x12"}
      iex> Console.Cli.MapName.parse("floor.yaml", ".")
      {:ok, "floor.yaml"}
      iex> {:error, {_allowed, hint}} = Console.Cli.MapName.parse("ofices", ".")
      iex> hint
      "; did you mean offices?"
  """
  @spec parse(String.t(), Path.t()) ::
          {:ok, String.t()} | {:error, String.t() | {String.t(), hint :: String.t()}}
  def parse(text, folder) do
    cond do
      Maps.built_in?(text) -> {:ok, text}
      text =~ ~r/.\.ya?ml\z/i -> {:ok, from(text, folder)}
      true -> picture(text, folder)
    end
  end

  @doc """
  Several of them, with commas between.

      iex> Console.Cli.MapName.list("hall,floor.png:16x12")
      {:ok, ["hall", "floor.png:16x12"]}
  """
  @spec list(String.t()) ::
          {:ok, [String.t()]} | {:error, String.t() | {String.t(), hint :: String.t()}}
  def list(text) do
    maps = for name <- String.split(text, ","), do: parse(name, ".")

    case Enum.find(maps, &(elem(&1, 0) == :error)) do
      nil ->
        {:ok, for({:ok, map} <- maps, do: map)}

      {:error, {allowed, hint}} ->
        {:error, {"some of " <> allowed <> ", with commas between,", hint}}

      {:error, allowed} ->
        {:error, allowed}
    end
  end

  @doc "The names of the built-in maps in lines, for a help text."
  @spec names() :: String.t()
  def names, do: Maps.names() |> Enum.chunk_every(7) |> Enum.map_join(",\n", &Enum.join(&1, ", "))

  defp picture(text, folder) do
    # What kind of picture it is, the file itself says.
    with [_, file, width, height] <-
           Regex.run(~r/\A(.+):(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)\z/is, text),
         false <- file =~ ~r/\.ya?ml\z/i do
      sized(from(file, folder), width, height)
    else
      _no_picture -> {:error, Maps.fault(text)}
    end
  end

  defp sized(file, width, height) do
    with {:ok, _} <- Parse.number(width, 2, 1000), {:ok, _} <- Parse.number(height, 2, 1000) do
      {:ok, "#{file}:#{width}x#{height}"}
    else
      _ -> {:error, "FILE:WIDTHxHEIGHT with sides from 2 to 1000 metres"}
    end
  end

  @doc """
  What is to be said behind the name of a map in whose picture grey was taken for wall; `option` is how to have it otherwise.

      iex> Console.Cli.MapName.grey(%{map: %{grey: 178}}, "--grey floor")
      " (grey is wall; --grey floor makes it floor)"
      iex> Console.Cli.MapName.grey(%{map: %{grey: nil}}, "--grey floor")
      ""
  """
  @spec grey(Sim.Scene.t() | Lab.Trial.t(), option :: String.t()) :: String.t()
  def grey(%{map: %{grey: shade}}, option) when shade != nil,
    do: " (grey is wall; #{option} makes it floor)"

  def grey(_scene, _option), do: ""

  @doc "A path, relative to a folder."
  @spec from(Path.t(), Path.t()) :: Path.t()
  def from(path, "."), do: path
  def from(path, folder), do: Path.expand(path, folder)
end
