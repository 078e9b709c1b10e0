defmodule Nav.MapFile.Description do
  @moduledoc false
  # Reads the description of a map in YAML, as map_server writes it: a line `key: value` for each of `image`
  # (a file beside it), `resolution` (metres a pixel), `origin` (`[x, y, turn]`: where the lower left
  # corner of the picture lies, and how far it is turned round that, counterclockwise in radians), and
  # optionally `occupied_thresh`, `free_thresh`, `negate` and `mode`; and `marks`, which map_server ignores: a list of lines
  # `- [id, x, y, turn]`, where printed marks hang in the map and how each faces (metres, radians), or `- [id, x, y, turn, sd]` with the standard deviation of the place.
  # Read as data: no other YAML is understood, other keys are ignored. Pure.
  #
  # A pixel is as occupied as it is dark, from 0 to 1, or as it is light if `negate` is 1. What is not
  # surely free, less than `free_thresh`, is wall; so is 205, which map_server writes for what it does
  # not know, and what is transparent, which gets a shade (`transparent`) that is wall. With `mode: raw` the shades are no
  # shades but the share in per cent, and what is above 100 is unknown. `known` are those of the shades that are surely wall, at
  # least `occupied_thresh`.

  @enforce_keys [:image, :resolution, :origin, :shades, :known, :transparent]
  defstruct @enforce_keys ++ [marks: []]

  @type t :: %__MODULE__{
          image: String.t(),
          resolution: float(),
          origin: {x :: float(), y :: float(), turn :: float()},
          shades: Nav.MapFile.Runs.marks(),
          known: Nav.MapFile.Runs.marks(),
          transparent: byte(),
          marks: [
            {id :: non_neg_integer(),
             {x :: float(), y :: float(), turn :: float()}
             | {x :: float(), y :: float(), turn :: float(), sd :: float()}}
          ]
        }

  # Radians; a whole turn is as good as none, and a number of degrees is a mistake.
  @most_turn 6.3

  @needed ~w(image resolution origin)
  @known @needed ++ ~w(occupied_thresh free_thresh negate mode marks)

  @doc """
  Reads a description; the error is one line.

      iex> yaml = "image: floor.pgm\\nresolution: 0.05\\norigin: [-8.0, -6.0, 0.0]\\n"
      iex> {:ok, description} = Nav.MapFile.Description.parse(yaml)
      iex> {description.image, description.resolution, description.origin}
      {"floor.pgm", 0.05, {-8.0, -6.0, 0.0}}
      iex> {:ok, marked} = Nav.MapFile.Description.parse(yaml <> "marks:\\n  - [7, 1.5, -2, 1.57] # in the hall\\n  - [8, 0, 0, 0]\\n")
      iex> marked.marks
      [{7, {1.5, -2.0, 1.57}}, {8, {0.0, 0.0, 0.0}}]
      iex> Nav.MapFile.Description.parse(yaml <> "marks:\\n  - [7, 1.5]\\n")
      {:error, "marks: expected lines - [id, x, y, turn], in metres and radians, got [[7, 1.5]]"}
      iex> Nav.MapFile.Description.parse("image: floor.pgm")
      {:error, "resolution is missing; needed are image, resolution, origin"}
  """
  @spec parse(binary()) :: {:ok, t()} | {:error, String.t()}
  def parse(bytes) do
    with {:ok, keys} <- keys(bytes),
         {:ok, image} <- image(keys),
         {:ok, resolution} <- number(keys, "resolution", nil, 0.001, 10.0),
         {:ok, origin} <- origin(keys["origin"]),
         {:ok, marks} <- marks(Map.get(keys, "marks", "[]")),
         {:ok, occupied} <- number(keys, "occupied_thresh", 0.65, 0.0, 1.0),
         {:ok, free} <- number(keys, "free_thresh", min(0.196, occupied), 0.0, 1.0),
         {:ok, light?} <- negate(Map.get(keys, "negate", "0")),
         {:ok, mode} <- mode(Map.get(keys, "mode", "trinary"), light?),
         :ok <- some_floor(min(free, occupied)) do
      {:ok,
       struct!(__MODULE__,
         image: image,
         resolution: resolution,
         origin: origin,
         marks: marks,
         shades: shades(mode, min(free, occupied), light?),
         known: known(mode, occupied, light?),
         transparent: if(mode == :raw or light?, do: 254, else: 0)
       )}
    end
  end

  defp keys(bytes) do
    with true <- String.valid?(bytes),
         lines = bytes |> String.split(["\r\n", "\n", "\r"]) |> Enum.map(&plain/1),
         {:ok, keys} <- entries(lines, []) do
      case @needed -- Map.keys(keys) do
        [] -> {:ok, keys}
        [key | _] -> {:error, "#{key} is missing; needed are #{Enum.join(@needed, ", ")}"}
      end
    else
      false -> {:error, "is not text"}
      {:error, _line} = error -> error
    end
  end

  defp entries([], done), do: {:ok, Map.new(done)}

  defp entries([line | rest], done) do
    with [key, value] <- :binary.split(line, ":"),
         key = String.trim_trailing(key),
         true <- key in @known do
      {value, rest} = value(key, String.trim(value), rest)

      if List.keymember?(done, key, 0),
        do: {:error, "#{key} is given twice"},
        else: entries(rest, [{key, value} | done])
    else
      _another_line -> entries(rest, done)
    end
  end

  # An origin may also be written as a list of lines that begin with a dash, and marks are.
  defp value(key, "", lines) when key in ["origin", "marks"] do
    {items, rest} = Enum.split_while(lines, &(item(&1) != nil or String.trim(&1) == ""))
    {"[#{items |> Enum.map(&item/1) |> Enum.filter(& &1) |> Enum.join(", ")}]", rest}
  end

  defp value(_key, text, lines), do: {text, lines}

  defp item(line) do
    case String.trim(line) do
      "- " <> item -> String.trim(item)
      _other -> nil
    end
  end

  # Without its remark, which begins with a # behind a blank, but not in a quoted value.
  defp plain(line) do
    with [key, value] <- :binary.split(line, ":"),
         <<quote, rest::binary>> when quote in ~c"\"'" <- String.trim_leading(value),
         [quoted, rest] <- :binary.split(rest, <<quote>>),
         do: key <> ":" <> <<quote>> <> quoted <> <<quote>> <> remarkless(rest),
         else: (_unquoted -> remarkless(line))
  end

  defp remarkless("#" <> _remark), do: ""

  defp remarkless(text) do
    case :binary.match(text, [" #", "\t#"]) do
      {at, _length} -> binary_part(text, 0, at)
      :nomatch -> text
    end
  end

  defp image(%{"image" => text}) do
    case unquoted(text) do
      {:ok, file} when file != "" -> {:ok, file}
      _none -> {:error, "image: expected the name of a PNG, PGM or BMP file"}
    end
  end

  defp unquoted(<<c, rest::binary>>) when c in ~c"\"'" do
    case :binary.split(rest, <<c>>) do
      [file, ""] -> {:ok, file}
      _open_or_more -> :error
    end
  end

  defp unquoted(text), do: {:ok, text}

  defp number(keys, key, default, least, most) do
    case parsed(Map.get(keys, key)) do
      nil when is_number(default) ->
        {:ok, default}

      number when is_float(number) and number >= least and number <= most ->
        {:ok, number}

      _wrong ->
        {:error, "#{key}: expected a number from #{least} to #{most}, got #{keys[key]}"}
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
         [_x, _y | turn] = parts when length(turn) <= 1 <-
           inner |> String.split(",") |> Enum.map(&parsed(String.trim(&1))),
         true <- Enum.all?(parts, &is_float/1),
         [x, y, turn | _] = parts ++ [0.0],
         true <- abs(x) <= 1.0e6 and abs(y) <= 1.0e6 and abs(turn) <= @most_turn do
      {:ok, {x, y, turn + 0.0}}
    else
      _other -> {:error, "origin: expected [x, y, turn] in metres and radians, got #{text}"}
    end
  end

  defp marks(text) do
    with [_, inner] <- Regex.run(~r/^\[(.*)\]$/, text),
         lists = Regex.scan(~r/\[([^\]]*)\]/, inner, capture: :all_but_first),
         true <- String.replace(inner, ~r/\[[^\]]*\]|[\s,]/, "") == "",
         marks = Enum.map(lists, fn [list] -> list |> String.split(",") |> mark() end),
         true <- Enum.all?(marks) do
      {:ok, marks}
    else
      _other ->
        {:error, "marks: expected lines - [id, x, y, turn], in metres and radians, got #{text}"}
    end
  end

  # The standard deviation of the place may follow.
  defp mark(parts) do
    with [id, x, y, turn | sd] = all when length(sd) <= 1 <-
           Enum.map(parts, &parsed(String.trim(&1))),
         true <- Enum.all?(all, &is_float/1),
         true <- id == trunc(id) and id >= 0.0 and id <= 65_535.0,
         true <- abs(x) <= 1.0e6 and abs(y) <= 1.0e6 and abs(turn) <= @most_turn,
         true <- Enum.all?(sd, &(&1 >= 0.0 and &1 <= 1.0e6)),
         do: {trunc(id), List.to_tuple([x, y, turn | sd])},
         else: (_wrong -> nil)
  end

  defp negate(text) when text in ~w(0 false), do: {:ok, false}
  defp negate(text) when text in ~w(1 true), do: {:ok, true}
  defp negate(text), do: {:error, "negate: expected 0 or 1, got #{text}"}

  defp mode(text, _light?) when text in ~w(trinary scale), do: {:ok, :shades}
  defp mode("raw", false), do: {:ok, :raw}

  defp mode("raw", true),
    do:
      {:error,
       "mode: raw with negate: 1 means one thing in ROS 1 and another in ROS 2; invert the picture"}

  defp mode(text, _light?), do: {:error, "mode: expected trinary, scale or raw, got #{text}"}

  defp some_floor(free) when free > 0.0, do: :ok

  defp some_floor(_nothing_free),
    do:
      {:error,
       "free_thresh: 0 leaves no floor: this is a mask, of speeds or of zones, and no floor plan"}

  defp shades(:raw, free, _light?),
    do: Nav.MapFile.Runs.marks(&(&1 > 100 or &1 / 100 >= free))

  defp shades(:shades, free, light?) do
    Nav.MapFile.Runs.marks(&(occupied(&1, light?) >= free or (&1 == 205 and not light?)))
  end

  defp known(:raw, most, _light?), do: Nav.MapFile.Runs.marks(&(&1 <= 100 and &1 / 100 >= most))

  defp known(:shades, most, light?),
    do: Nav.MapFile.Runs.marks(&(occupied(&1, light?) >= most and (&1 != 205 or light?)))

  defp occupied(shade, light?), do: if(light?, do: shade / 255, else: (255 - shade) / 255)
end
