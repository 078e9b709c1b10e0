defmodule Vision.Colours.Text do
  @moduledoc false
  # CMVision's reader is a machine with three states: it looks for a header, or it is inside one
  # of the two sections. This is that machine; it also remembers which line ended a section, to
  # be able to say why something is missing. The lines themselves `Vision.Colours.Line` reads.
  alias Vision.Colours.Line

  @longest 255
  @forms %{
    colours: "(R,G,B) merge expected Name with R, G, B from 0 to 255",
    thresholds: "(Ylo:Yhi,Ulo:Uhi,Vlo:Vhi) with whole numbers"
  }

  @type line_error :: {pos_integer(), String.t()} | String.t()

  @spec classes(binary()) :: {:ok, [map()]} | {:error, line_error()}
  def classes(text) do
    with :ok <- check_text(text),
         {:ok, scan} <- scan(text),
         :ok <- check_counts(scan) do
      {:ok,
       Enum.zip_with(Enum.reverse(scan.colours), Enum.reverse(scan.thresholds), &Map.merge/2)}
    end
  end

  defp check_text(text) do
    cond do
      not String.valid?(text) or String.contains?(text, <<0>>) ->
        {:error, "not a text file"}

      String.starts_with?(text, <<0xFEFF::utf8>>) ->
        {:error, "begins with a byte order mark, which hides its first line: save it without"}

      String.trim(text) == "" ->
        {:error, "is empty: it needs a [Colors] and a [Thresholds] section"}

      true ->
        :ok
    end
  end

  defp scan(text) do
    start = %{section: nil, seen: [], colours: [], thresholds: [], swallowed: nil, ended: %{}}

    text
    |> String.split("\n")
    |> Enum.with_index(1)
    |> Enum.reduce_while({:ok, start}, fn {line, number}, {:ok, scan} ->
      case read_line(String.trim_trailing(line, "\r"), number, scan) do
        {:error, reason} -> {:halt, {:error, {number, reason}}}
        scan -> {:cont, {:ok, scan}}
      end
    end)
  end

  defp read_line(line, _number, _scan) when byte_size(line) > @longest,
    do: {:error, "expected at most #{@longest} bytes, got #{byte_size(line)}"}

  defp read_line(line, number, %{section: nil} = scan) do
    case header(line) do
      nil -> scan
      section -> if section in scan.seen, do: again(section), else: enter(scan, section, number)
    end
  end

  # A line that begins with a bracket was meant for the section: a broken one must not count as its end.
  defp read_line("(" <> rest = line, _number, %{section: section} = scan) do
    case Line.read(section, rest) do
      {:ok, read} when section == :colours -> colour(scan, read)
      {:ok, read} -> thresholds(scan, read)
      :error -> {:error, "#{inspect(line)} is not of the form #{@forms[section]}"}
    end
  end

  defp read_line(line, number, scan), do: leave(scan, line, number)

  defp enter(scan, section, _number), do: %{scan | section: section, seen: [section | scan.seen]}

  defp again(section), do: {:error, "expected one #{title(section)} section, got a second"}

  defp leave(scan, line, number) do
    ended = Map.put(scan.ended, scan.section, number)
    swallowed = scan.swallowed || (header(line) && {number, header(line)})
    %{scan | section: nil, ended: ended, swallowed: swallowed}
  end

  defp header(line) do
    lower = String.downcase(line)

    cond do
      String.starts_with?(lower, "[colors]") -> :colours
      String.starts_with?(lower, "[thresholds]") -> :thresholds
      true -> nil
    end
  end

  defp colour(scan, %{name: name, rgb: rgb} = colour) do
    cond do
      not Enum.all?(Tuple.to_list(rgb), &(&1 in 0..255)) ->
        {:error, "the colour #{name} is not of the form #{@forms.colours}"}

      Enum.any?(scan.colours, &(&1.name == name)) ->
        {:error, "a second colour is named #{name}: each needs a name of its own"}

      true ->
        %{scan | colours: [colour | scan.colours]}
    end
  end

  defp thresholds(scan, [_, _, _, _, _, _] = limits) do
    pairs = limits |> Enum.chunk_every(2) |> Enum.zip(~w(Y U V))

    case Enum.find(pairs, fn {[lowest, highest], _channel} ->
           lowest < 0 or highest > 255 or lowest > highest
         end) do
      nil ->
        [y, u, v] = limits |> Enum.chunk_every(2) |> Enum.map(&List.to_tuple/1)
        %{scan | thresholds: [%{y: y, u: u, v: v} | scan.thresholds]}

      {[lowest, highest], channel} ->
        {:error,
         "threshold #{channel}: expected 0 to 255, the lower number first, got #{lowest}:#{highest}"}
    end
  end

  defp check_counts(%{swallowed: {number, section}, seen: [only]}) when only != section do
    {:error,
     {number,
      "the #{title(section)} header needs a blank line before it, or it is taken for the end of #{title(only)}"}}
  end

  defp check_counts(%{colours: [], thresholds: []}),
    do: {:error, "no colours found: it needs a [Colors] and a [Thresholds] section"}

  defp check_counts(%{colours: colours, thresholds: thresholds, ended: ended})
       when length(colours) != length(thresholds) do
    hint =
      for section <- [:colours, :thresholds], line = ended[section] do
        "; #{title(section)} ended at line #{line}"
      end

    {:error,
     "#{length(colours)} colours but #{length(thresholds)} thresholds: one line each is needed#{hint}"}
  end

  defp check_counts(_scan), do: :ok

  defp title(:colours), do: "[Colors]"
  defp title(:thresholds), do: "[Thresholds]"
end
