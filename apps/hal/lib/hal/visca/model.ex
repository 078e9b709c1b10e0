defmodule Hal.Visca.Model do
  @moduledoc """
  Lists the cameras that this driver knows, with their units and ranges (Sony's command lists and the translation tables
  of their D30 mode). Pure.

  | | code | pan | tilt | zoom | lens | turns at most |
  |---|---|---|---|---|---|---|
  | EVI-D30, D31 | 0x0402 | 100 degrees to each side, 8.8 a degree | 25 degrees each way, 12 a degree | 0 to 0x3FF | 4.4 to 48.8 degrees | 80 and 50 degrees/s |
  | EVI-D70 | 0x040E | 170, 13.33 | -30 to 90, 13.33 | 0 to 0x4000 | 2.7 to 48 | 100 and 90 |
  | EVI-D100 | 0x040D | 100, 14.4 | 25 each way, 14.4 | 0 to 0x4000 | 6.6 to 65 | 300 and 125 |

  A D70 or D100 whose switch for the D30 mode is on says that it is a D30, and takes a D30's units.
  Units of another camera would turn a head to somewhere else: what is not in this table is refused.
  """

  @degree :math.pi() / 180

  @keys [:key, :name, :code, :pan_degree, :pan, :tilt_degree, :tilt, :zoom_span, :zoom] ++
          [:lens, :pan_rate, :tilt_rate]
  @enforce_keys @keys
  defstruct @keys

  @type key :: :d30 | :d70 | :d100
  @typedoc """
  `pan` and `tilt` are the ends `{least, greatest}` in the camera's units, `pan_degree` and
  `tilt_degree` the units of a degree; `zoom` is the greatest zoom, `zoom_span` the number by which
  the lens goes from wide to tele; `lens` has the fields of view `{tele, wide}` in radians; the rates
  are degrees a second.
  """
  @type t :: %__MODULE__{
          key: key(),
          name: String.t(),
          code: 0..0xFFFF,
          pan_degree: float(),
          pan: {integer(), integer()},
          tilt_degree: float(),
          tilt: {integer(), integer()},
          zoom_span: pos_integer(),
          zoom: pos_integer(),
          lens: {float(), float()},
          pan_rate: pos_integer(),
          tilt_rate: pos_integer()
        }

  # Cameras that name their model, and have no head, or one that turns in other units.
  @others %{
    0x0401 => "FCB-IX47",
    0x0404 => "FCB-IX10",
    0x0411 => "FCB-EX780",
    0x0412 => "FCB-EX480A",
    0x0413 => "FCB-EX480AP",
    0x0420 => "FCB-EX780B",
    0x0424 => "FCB-EX480B",
    0x042E => "FCB-EX980S",
    0x0430 => "FCB-EX980",
    0x044A => "FCB-H10"
  }

  @doc "The models by their keys, as `model:` in a robot file names them."
  @spec keys() :: [key(), ...]
  def keys, do: [:d30, :d70, :d100]

  @doc """
  A model.

      iex> Hal.Visca.Model.get(:d100).pan
      {-1440, 1440}
  """
  @spec get(key()) :: t()
  def get(:d30) do
    %__MODULE__{
      key: :d30,
      name: "EVI-D30",
      code: 0x0402,
      pan_degree: 8.8,
      pan: {-880, 880},
      tilt_degree: 12.0,
      tilt: {-300, 300},
      zoom_span: 0x400,
      zoom: 0x3FF,
      lens: {4.4 * @degree, 48.8 * @degree},
      pan_rate: 80,
      tilt_rate: 50
    }
  end

  def get(:d70) do
    %__MODULE__{
      key: :d70,
      name: "EVI-D70",
      code: 0x040E,
      pan_degree: 2267 / 170,
      pan: {-2267, 2267},
      tilt_degree: 1200 / 90,
      tilt: {-400, 1200},
      zoom_span: 0x4000,
      zoom: 0x4000,
      lens: {2.7 * @degree, 48.0 * @degree},
      pan_rate: 100,
      tilt_rate: 90
    }
  end

  def get(:d100) do
    %__MODULE__{
      key: :d100,
      name: "EVI-D100",
      code: 0x040D,
      pan_degree: 14.4,
      pan: {-1440, 1440},
      tilt_degree: 14.4,
      tilt: {-360, 360},
      zoom_span: 0x4000,
      zoom: 0x4000,
      lens: {6.6 * @degree, 65.0 * @degree},
      pan_rate: 300,
      tilt_rate: 125
    }
  end

  @doc """
  The model with this code.

      iex> {:ok, model} = Hal.Visca.Model.of(0x040E)
      iex> model.name
      "EVI-D70"
      iex> Hal.Visca.Model.of(0x0411)
      :error
  """
  @spec of(non_neg_integer()) :: {:ok, t()} | :error
  def of(code) do
    case Enum.find(keys(), &(get(&1).code == code)) do
      nil -> :error
      key -> {:ok, get(key)}
    end
  end

  @doc """
  The name of a code, with the code.

      iex> Enum.map([0x0402, 0x0411, 0x0510], &Hal.Visca.Model.words/1)
      ["EVI-D30 (0x0402)", "FCB-EX780 (0x0411)", "of the unknown model 0x0510"]
  """
  @spec words(non_neg_integer()) :: String.t()
  def words(code) do
    hex = hex(code)

    case of(code) do
      {:ok, %{name: name}} -> "#{name} (#{hex})"
      :error when is_map_key(@others, code) -> "#{@others[code]} (#{hex})"
      :error -> "of the unknown model #{hex}"
    end
  end

  @doc """
  A number of the camera as its manuals write it.

      iex> Hal.Visca.Model.hex(0x3FF)
      "0x03FF"
  """
  @spec hex(non_neg_integer()) :: String.t()
  def hex(n), do: "0x" <> (n |> Integer.to_string(16) |> String.pad_leading(4, "0"))

  @doc """
  Where its head can look, in radians, left and up positive.

      iex> {{_right, left}, _tilt} = Hal.Visca.Model.reach(Hal.Visca.Model.get(:d30))
      iex> Float.round(left, 3)
      1.745
  """
  @spec reach(t()) :: {{float(), float()}, {float(), float()}}
  def reach(%__MODULE__{pan: {first, last}, tilt: {down, up}} = model) do
    pan = fn units -> (0 - units) / model.pan_degree * @degree end
    tilt = fn units -> units / model.tilt_degree * @degree end
    {{pan.(last), pan.(first)}, {tilt.(down), tilt.(up)}}
  end
end
