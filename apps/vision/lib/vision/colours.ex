defmodule Vision.Colours do
  @moduledoc """
  Holds the colours to look for: up to 32 classes, each a box in YUV, read from a CMVision colour file.

      [Colors]
      (255,255,0) 0.500000 10 YellowLandmark

      [Thresholds]
      (170:240, 60: 90,130:145)

  Line k below `[Colors]` and line k below `[Thresholds]` are one class. The colour is only for
  display; `merge` and `expected` are kept but have no effect, as in Player's driver. Limits are
  inclusive. YUV is full range, as in `Vision.Rgb`.

  A file is read as CMVision reads it: a line of another form (blank, comment) ends its section
  and is consumed, so a **blank line between the sections is required**, and a comment within a
  section cuts it short. Unknown sections are skipped. Where CMVision would go on with classes
  that can never be seen, this reader reports an error instead: thresholds that are missing or
  surplus, a colour without a name, two of one name, limits outside 0 to 255 (CMVision clamps them, which hides typing errors) or the wrong
  way round, broken numbers, lines above 255 bytes.

  Options of `parse/2`, `read/2` and `new/2`:

    * `:distance` - `%{name => k}`: a blob of that colour that fills the share s of the frame is
      `sqrt(k / s)` metres away, so `k` is its share at 1 m;
    * `:min_area` - smallest blob in pixels (20); `:max_area` - largest (0: no limit);
    * `:backend` - the `Vision.Backend` to use (`nil`: the fastest that reads the frame).
  """
  alias Vision.Colours.Text

  @enforce_keys [:classes, :min_area, :max_area, :tables]
  defstruct @enforce_keys ++ [backend: nil]

  @type limits :: {lowest :: 0..255, highest :: 0..255}
  @type class :: %{
          name: String.t(),
          rgb: {0..255, 0..255, 0..255},
          merge: float(),
          expected: integer(),
          y: limits(),
          u: limits(),
          v: limits(),
          distance: float() | nil
        }

  @typedoc "`tables` are CMVision's: 256 masks of 32 bits each for Y, U and V."
  @type t :: %__MODULE__{
          classes: [class(), ...],
          min_area: pos_integer(),
          max_area: non_neg_integer(),
          tables: binary(),
          backend: module() | nil
        }

  @most 32
  @largest_file 1_048_576
  @largest_area 0xFFFFFFFF

  @doc """
  The colours in the file at `path`; the error is one line that names the file and, if it is in a
  line of the text, that line.

      iex> Vision.Colours.read("no/such/file")
      {:error, "no/such/file: no such file or directory"}
  """
  @spec read(Path.t(), keyword()) :: {:ok, t()} | {:error, String.t()}
  def read(path, options \\ []) do
    # A pipe or a device may never end.
    with {:ok, %File.Stat{type: :regular, size: size}} when size <= @largest_file <-
           File.stat(path),
         {:ok, text} <- File.read(path) do
      parse(text, [{:file, path} | options])
    else
      {:ok, %File.Stat{type: :regular}} ->
        {:error, "#{path}: no colour file is larger than #{div(@largest_file, 1024)} kB"}

      {:ok, %File.Stat{type: :directory}} ->
        {:error, "#{path}: #{:file.format_error(:eisdir)}"}

      {:ok, %File.Stat{}} ->
        {:error, "#{path}: a pipe or device, where a file is needed"}

      {:error, reason} ->
        {:error, "#{path}: #{:file.format_error(reason)}"}
    end
  end

  @doc """
  The colours in the text of a colour file. The option `:file` is its name in errors.

      iex> text = "[Colors]\\n(255,255,0) 0.5 10 Yellow\\n\\n[Thresholds]\\n(170:240, 60: 90,130:145)\\n"
      iex> {:ok, colours} = Vision.Colours.parse(text, distance: %{"Yellow" => 0.0651})
      iex> [%{name: "Yellow", u: {60, 90}, distance: 0.0651}] = colours.classes
      iex> Vision.Colours.parse(String.replace(text, "\\n\\n", "\\n"), file: "colours.txt")
      {:error, "colours.txt:3: the [Thresholds] header needs a blank line before it, or it is taken for the end of [Colors]"}
  """
  @spec parse(String.t(), keyword()) :: {:ok, t()} | {:error, String.t()}
  def parse(text, options \\ []) do
    {file, options} = Keyword.pop(options, :file, "colour file")

    with {:ok, classes} <- Text.classes(text),
         {:ok, colours} <- new(classes, options) do
      {:ok, colours}
    else
      {:error, {line, reason}} -> {:error, "#{file}:#{line}: #{reason}"}
      {:error, reason} -> {:error, "#{file}: #{reason}"}
    end
  end

  @doc """
  Colours from classes, without a file; `rgb`, `merge` and `expected` may be left out.

      iex> {:ok, colours} = Vision.Colours.new([%{name: "Red", y: {20, 170}, u: {80, 120}, v: {150, 240}}])
      iex> Vision.Colours.mask(colours, {100, 100, 200})
      1
      iex> Vision.Colours.new([])
      {:error, "expected 1 to 32 colours, got none"}
  """
  @spec new([map()], keyword()) :: {:ok, t()} | {:error, String.t()}
  def new(classes, options \\ []) do
    options = Keyword.validate!(options, distance: %{}, min_area: 20, max_area: 0, backend: nil)
    names = Enum.map(classes, & &1.name)

    with :ok <- check_count(length(classes)),
         :ok <- check_names(names),
         :ok <- check_area(:min_area, options[:min_area], 1),
         :ok <- check_area(:max_area, options[:max_area], 0),
         :ok <- check_distances(options[:distance], names),
         :ok <- check_backend(options[:backend]) do
      classes = Enum.map(classes, &class(&1, options[:distance]))

      {:ok,
       %__MODULE__{
         classes: classes,
         min_area: options[:min_area],
         max_area: options[:max_area],
         tables: tables(classes),
         backend: options[:backend]
       }}
    end
  end

  @doc "The mask of a YUV pixel by the tables: bit k is set if class k allows the pixel."
  @spec mask(t(), {0..255, 0..255, 0..255}) :: 0..0xFFFFFFFF
  def mask(%__MODULE__{tables: tables}, {y, u, v}) do
    import Bitwise
    entry(tables, y) &&& entry(tables, 256 + u) &&& entry(tables, 512 + v)
  end

  defp entry(tables, index) do
    <<mask::32-native>> = binary_part(tables, 4 * index, 4)
    mask
  end

  defp class(class, distances) do
    %{rgb: {255, 255, 255}, merge: 1.0, expected: 1}
    |> Map.merge(class)
    |> Map.put(:distance, distances[class.name])
  end

  defp tables(classes) do
    for channel <- [:y, :u, :v], value <- 0..255, into: <<>> do
      bits = for class <- Enum.reverse(classes), do: bit(class[channel], value)
      <<Integer.undigits(bits, 2)::32-native>>
    end
  end

  defp bit({lowest, highest}, value) when value >= lowest and value <= highest, do: 1
  defp bit(_limits, _value), do: 0

  defp check_count(0), do: {:error, "expected 1 to #{@most} colours, got none"}
  defp check_count(n) when n <= @most, do: :ok
  defp check_count(n), do: {:error, "expected 1 to #{@most} colours, got #{n}"}

  defp check_names(names) do
    case names -- Enum.uniq(names) do
      [] -> :ok
      [name | _] -> {:error, "two colours are named #{name}: each needs a name of its own"}
    end
  end

  defp check_area(_option, area, least) when area in least..@largest_area//1, do: :ok

  defp check_area(option, area, least),
    do: {:error, "#{option}: expected whole numbers from #{least}, got #{inspect(area)}"}

  defp check_backend(nil), do: :ok

  defp check_backend(backend) do
    if is_atom(backend) and Code.ensure_loaded?(backend) and
         function_exported?(backend, :regions, 2),
       do: :ok,
       else: {:error, "backend: expected a Vision.Backend, got #{inspect(backend)}"}
  end

  defp check_distances(distances, names) do
    Enum.find_value(distances, :ok, fn {name, constant} ->
      cond do
        name not in names ->
          {:error, "distance for #{name}, but the colours are #{Enum.join(names, ", ")}"}

        not (is_number(constant) and constant > 0) ->
          {:error, "distance for #{name}: expected a number above 0, got #{inspect(constant)}"}

        true ->
          nil
      end
    end)
  end
end
