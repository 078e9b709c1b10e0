defmodule Robot.Navigation.MapFile.Description do
  @moduledoc """
  The description of a map in YAML, as map_server writes it: a line `key: value` for each of `image`
  (a file beside it), `resolution` (metres a pixel), `origin` (`[x, y, turn]`: where the lower left
  corner of the picture lies), and optionally `occupied_thresh`, `free_thresh`, `negate` and `mode`.
  Read as data: no other YAML is understood, other keys are ignored. Pure.

  A pixel is as occupied as it is dark, from 0 to 1, or as it is light if `negate` is 1. What is not
  surely free, less than `free_thresh`, is wall; so is 205, which map_server writes for what it does
  not know.
  """

  @enforce_keys [:image, :resolution, :origin, :shades]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          image: String.t(),
          resolution: float(),
          origin: {float(), float()},
          shades: Robot.Navigation.MapFile.Runs.marks()
        }

  @needed ~w(image resolution origin)
  @known @needed ++ ~w(occupied_thresh free_thresh negate mode)

  @doc """
  Reads a description; the error is one line.

      iex> yaml = "image: floor.pgm\\nresolution: 0.05\\norigin: [-8.0, -6.0, 0.0]\\n"
      iex> {:ok, description} = Robot.Navigation.MapFile.Description.parse(yaml)
      iex> {description.image, description.resolution, description.origin}
      {"floor.pgm", 0.05, {-8.0, -6.0}}
      iex> Robot.Navigation.MapFile.Description.parse("image: floor.pgm")
      {:error, "resolution is missing; needed are image, resolution, origin"}
  """
  @spec parse(binary()) :: {:ok, t()} | {:error, String.t()}
  def parse(bytes) do
    with {:ok, keys} <- keys(bytes),
         {:ok, image} <- image(keys),
         {:ok, resolution} <- number(keys, "resolution", nil, 0.001, 10.0),
         {:ok, origin} <- origin(keys["origin"]),
         {:ok, occupied} <- number(keys, "occupied_thresh", 0.65, 0.0, 1.0),
         {:ok, free} <- number(keys, "free_thresh", min(0.196, occupied), 0.0, 1.0),
         {:ok, light?} <- negate(Map.get(keys, "negate", "0")),
         :ok <- mode(Map.get(keys, "mode", "trinary")) do
      shades = shades(min(free, occupied), light?)

      {:ok,
       struct!(__MODULE__, image: image, resolution: resolution, origin: origin, shades: shades)}
    end
  end

  defp keys(bytes) do
    if String.valid?(bytes) do
      # An origin may also be written as a list of lines that begin with a dash.
      text = Regex.replace(~r/^origin:\s*\r?\n((?:\s*-\s+\S+[ \t]*\r?\n?)+)/m, bytes, &flow/2)

      keys =
        for line <- String.split(text, ["\n", "\r"]),
            [_, key, value] <- [Regex.run(~r/^(\w+)\s*:\s*(.*?)\s*$/, plain(line))],
            key in @known,
            into: %{},
            do: {key, value}

      case @needed -- Map.keys(keys) do
        [] -> {:ok, keys}
        [key | _] -> {:error, "#{key} is missing; needed are #{Enum.join(@needed, ", ")}"}
      end
    else
      {:error, "is not text"}
    end
  end

  defp flow(_whole, items) do
    numbers = for [_, item] <- Regex.scan(~r/-\s+(\S+)/, items), do: item
    "origin: [#{Enum.join(numbers, ", ")}]\n"
  end

  # Without its remark.
  defp plain(line), do: Regex.replace(~r/(^|\s)#.*$/, line, "")

  defp image(%{"image" => text}) do
    case Regex.run(~r/^(["']?)(.+)\1$/, text) do
      [_, _quote, file] -> {:ok, file}
      nil -> {:error, "image must be the name of a PNG or PGM file"}
    end
  end

  defp number(keys, key, default, least, most) do
    case parsed(Map.get(keys, key)) do
      nil when is_number(default) ->
        {:ok, default}

      number when is_float(number) and number >= least and number <= most ->
        {:ok, number}

      _wrong ->
        {:error, "#{key} cannot be #{keys[key]}: a number from #{least} to #{most} is allowed"}
    end
  end

  defp parsed(nil), do: nil

  defp parsed(text) do
    with [_] <- Regex.run(~r/^[-+]?\d{1,12}(?:\.\d*)?(?:[eE][-+]?\d{1,2})?$/, text),
         {number, rest} when rest in ["", "."] <- Float.parse(text) do
      number
    else
      _other -> :error
    end
  end

  defp origin(text) do
    with [_, inner] <- Regex.run(~r/^\[(.*)\]$/, text),
         [x, y | turn] when length(turn) <= 1 <-
           inner |> String.split(",") |> Enum.map(&String.trim/1),
         [x, y] = [parsed(x), parsed(y)],
         true <- is_float(x) and is_float(y) and abs(x) <= 1.0e6 and abs(y) <= 1.0e6 do
      if Enum.all?(turn, &(parsed(&1) in [0.0, -0.0])),
        do: {:ok, {x, y}},
        else:
          {:error, "origin #{text} is turned, which is not supported: turn the picture instead"}
    else
      _other -> {:error, "origin cannot be #{text}: [x, y, 0.0] in metres is allowed"}
    end
  end

  defp negate(text) when text in ~w(0 false), do: {:ok, false}
  defp negate(text) when text in ~w(1 true), do: {:ok, true}
  defp negate(text), do: {:error, "negate cannot be #{text}: 0 or 1 is allowed"}

  defp mode(text) when text in ~w(trinary scale), do: :ok
  defp mode(text), do: {:error, "mode cannot be #{text}: trinary or scale is allowed"}

  defp shades(free, light?) do
    Robot.Navigation.MapFile.Runs.marks(fn shade ->
      occupied = if light?, do: shade / 255, else: (255 - shade) / 255
      occupied >= free or (shade == 205 and not light?)
    end)
  end
end
