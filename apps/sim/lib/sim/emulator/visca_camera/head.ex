defmodule Sim.Emulator.ViscaCamera.Head do
  @moduledoc false
  # Moves the parts of the camera: pan and tilt with the rates of their speed numbers, and zoom (fact sheet VISCA, section
  # 5). Pure; positions in the camera's units (pan to the right, tilt up, zoom to tele positive), times in milliseconds.
  #
  # An axis goes to a position or drives until it is stopped or at its end. Pan and tilt move
  # independently; a path may have several corners.

  @ends {880, 300}
  # Units a second for speed 1: 3.33 degrees of 8.8 units, 2.5 degrees of 12.
  @rates {3.33 * 8.8, 2.5 * 12.0}
  @tele 1023

  defstruct pan: 0.0,
            tilt: 0.0,
            zoom: 0.0,
            at_ms: 0,
            limits: {{-880, 880}, {-300, 300}},
            motion: :still,
            zooming: :still

  @typedoc """
  `motion` is `:still`, `{:to, [{pan, tilt}], rates}` or `{:drive, units_per_s}`; `zooming` is
  alike, with one number.
  """
  @type t :: %__MODULE__{}

  @doc "Whether it is on its way to a position, which a drive may not interrupt."
  @spec going?(t()) :: boolean()
  def going?(%__MODULE__{motion: motion}), do: match?({:to, _, _}, motion)

  @doc "Goes to these positions, one after the other, with these speed numbers."
  @spec go(t(), [{number(), number()}, ...], {1..24, 1..20}) :: t()
  def go(%__MODULE__{} = head, places, {pan_speed, tilt_speed}) do
    {pan_rate, tilt_rate} = @rates
    places = for {pan, tilt} <- places, do: within(head, pan, tilt)

    case Enum.drop_while(places, fn {pan, tilt} -> pan == head.pan and tilt == head.tilt end) do
      [] -> %{head | motion: :still}
      places -> %{head | motion: {:to, places, {pan_speed * pan_rate, tilt_speed * tilt_rate}}}
    end
  end

  @doc "Drives with signed speed numbers, 0 for an axis that stands."
  @spec drive(t(), {-24..24, -20..20}) :: t()
  def drive(%__MODULE__{} = head, {0, 0}), do: %{head | motion: :still}

  def drive(%__MODULE__{} = head, {pan, tilt}) do
    {pan_rate, tilt_rate} = @rates
    %{head | motion: {:drive, {pan * pan_rate, tilt * tilt_rate}}}
  end

  @doc "Zooms to a position; the whole way from wide to tele takes so many milliseconds."
  @spec zoom(t(), number(), pos_integer()) :: t()
  def zoom(%__MODULE__{} = head, place, all_ms) do
    place = place |> max(0) |> min(@tele)
    zooming = if place == head.zoom, do: :still, else: {:to, place, @tele * 1000 / all_ms}
    %{head | zooming: zooming}
  end

  @doc "Zooms in (1) or out (-1) until it is stopped (0)."
  @spec zoom_on(t(), -1 | 0 | 1, pos_integer()) :: t()
  def zoom_on(%__MODULE__{} = head, 0, _all_ms), do: %{head | zooming: :still}
  def zoom_on(head, 1, all_ms), do: zoom(head, @tele, all_ms)
  def zoom_on(head, -1, all_ms), do: zoom(head, 0, all_ms)

  @doc "Stops pan and tilt where they are."
  @spec stop(t()) :: t()
  def stop(%__MODULE__{} = head), do: %{head | motion: :still}

  @doc """
  Limits where it may look by a corner: 1 up and right, 0 down and left; `nil` removes both
  limits.
  """
  @spec limit(t(), 0 | 1, {integer(), integer()} | nil) :: t()
  def limit(%__MODULE__{limits: {{left, _}, {down, _}}} = head, 1, place) do
    {right, up} = place || @ends
    %{head | limits: {{left, max(left, min(right, 880))}, {down, max(down, min(up, 300))}}}
  end

  def limit(%__MODULE__{limits: {{_, right}, {_, up}}} = head, 0, place) do
    {left, down} = place || {-880, -300}
    %{head | limits: {{min(right, max(left, -880)), right}, {min(up, max(down, -300)), up}}}
  end

  defp within(%{limits: {{left, right}, {down, up}}}, pan, tilt),
    do: {pan |> max(left) |> min(right), tilt |> max(down) |> min(up)}

  @doc "The head at a later time."
  @spec advance(t(), integer()) :: t()
  def advance(%__MODULE__{at_ms: from} = head, at_ms) when at_ms > from,
    do: %{move(zoom_by(head, at_ms - from), (at_ms - from) * 1.0) | at_ms: at_ms}

  def advance(head, _same_ms), do: head

  defp zoom_by(%{zooming: :still} = head, _ms), do: head

  defp zoom_by(%{zooming: {:to, place, rate}} = head, ms) do
    case towards(head.zoom, place, rate * ms / 1000) do
      zoom when zoom == place -> %{head | zoom: zoom, zooming: :still}
      zoom -> %{head | zoom: zoom}
    end
  end

  defp move(%{motion: :still} = head, _ms), do: head

  defp move(%{motion: {:drive, {pan, tilt}}} = head, ms) do
    {pan, tilt} = within(head, head.pan + pan * ms / 1000, head.tilt + tilt * ms / 1000)
    %{head | pan: pan * 1.0, tilt: tilt * 1.0}
  end

  defp move(%{motion: {:to, [place | rest], rates}} = head, ms) do
    needs_ms = needs_ms(head, place, rates)
    {pan, tilt} = place
    {pan_rate, tilt_rate} = rates

    if needs_ms <= ms do
      head = %{head | pan: pan * 1.0, tilt: tilt * 1.0}
      motion = if rest == [], do: :still, else: {:to, rest, rates}
      move(%{head | motion: motion}, ms - needs_ms)
    else
      %{
        head
        | pan: towards(head.pan, pan, pan_rate * ms / 1000),
          tilt: towards(head.tilt, tilt, tilt_rate * ms / 1000)
      }
    end
  end

  defp needs_ms(head, {pan, tilt}, {pan_rate, tilt_rate}),
    do: 1000 * max(abs(pan - head.pan) / pan_rate, abs(tilt - head.tilt) / tilt_rate)

  @doc "When pan and tilt will be at their target; `nil` if they have none."
  @spec there_ms(t()) :: integer() | nil
  def there_ms(%__MODULE__{motion: {:to, places, rates}} = head) do
    {ms, _head} =
      Enum.reduce(places, {0.0, head}, fn {pan, tilt} = place, {ms, head} ->
        {ms + needs_ms(head, place, rates), %{head | pan: pan, tilt: tilt}}
      end)

    head.at_ms + ceil(ms)
  end

  def there_ms(_nowhere), do: nil

  @doc "The same for the zoom."
  @spec zoomed_ms(t()) :: integer() | nil
  def zoomed_ms(%__MODULE__{zooming: {:to, place, rate}} = head),
    do: head.at_ms + ceil(1000 * abs(place - head.zoom) / rate)

  def zoomed_ms(_nowhere), do: nil

  defp towards(from, to, most) when to > from + most, do: from + most
  defp towards(from, to, most) when to < from - most, do: from - most
  defp towards(_from, to, _most), do: to * 1.0

  @doc """
  The field of view of a lens, in radians; linear as in the sheet, although real lenses are not.
  """
  @spec field_of_view(t(), {tele :: number(), wide :: number()}) :: float()
  def field_of_view(%__MODULE__{zoom: zoom}, {tele, wide}), do: wide + zoom * (tele - wide) / 1024

  @doc "Its direction of view in radians, left and up positive."
  @spec angles(t()) :: {pan :: float(), tilt :: float()}
  def angles(%__MODULE__{pan: pan, tilt: tilt}),
    do: {-pan / 8.8 * :math.pi() / 180, tilt / 12.0 * :math.pi() / 180}
end
