defmodule Robot.Command.Arguments do
  @moduledoc false
  # Parses the arguments of commands: numbers, names of robots and colours. Pure; never creates
  # atoms from its input.

  # No place, speed or size of a robot is greater than this.
  @greatest 1.0e6

  @doc """
  The value of an argument, or what for it.

      iex> Robot.Command.Arguments.value(:x, "1e3", [])
      {:ok, 1000.0}
      iex> Robot.Command.Arguments.value(:x, "1,5", [])
      {:error, "a number, as in 2, -0.5 or 1.0e-3"}
      iex> Robot.Command.Arguments.value(:name, "mag9", [:mag1, :mag2])
      {:error, "one of mag1, mag2"}
  """
  @spec value(atom(), String.t(), [atom()]) :: {:ok, term()} | {:error, String.t()}
  def value(:name, text, known) do
    case Enum.find(known, &(Atom.to_string(&1) == text)) do
      nil -> {:error, names(known)}
      id -> {:ok, id}
    end
  end

  def value(:colour, "", _known), do: {:error, "a colour's name"}
  def value(:colour, text, _known), do: {:ok, text}
  def value(:mission, "", _known), do: {:error, "a mission's name"}
  def value(:mission, text, _known), do: {:ok, text}
  def value(:behaviour, "", _known), do: {:error, "a behaviour's name"}
  def value(:behaviour, text, _known), do: {:ok, text}
  def value(:kind, "", _known), do: {:error, "a kind of message"}
  def value(:kind, text, _known), do: {:ok, text}
  def value(name, text, _known) when name in [:options, :fields], do: {:ok, text}
  def value(:found, "0", _known), do: {:ok, false}
  def value(:found, "1", _known), do: {:ok, true}
  def value(:found, _text, _known), do: {:error, "0 or 1"}

  def value(name, text, _known) when name in [:size, :seconds] do
    case number(text) do
      {:ok, least} when least < 0 -> {:error, "a number from 0"}
      other -> other
    end
  end

  def value(_name, text, _known), do: number(text)

  defp names([]), do: "no robot is known"
  defp names(known), do: "one of #{Enum.map_join(known, ", ", &Atom.to_string/1)}"

  defp number(text) do
    if Regex.match?(pattern(), text),
      do: text |> float() |> in_range(),
      else: {:error, "a number, as in 2, -0.5 or 1.0e-3"}
  end

  # A decimal point in every locale; no infinity and no words.
  defp pattern, do: ~r/\A[+-]?(\d{1,20}(\.\d{0,20})?|\.\d{1,20})([eE][+-]?\d{1,3})?\z/

  # Erlang needs digits on both sides of the point, and raises if the number overflows.
  defp float(text) do
    {mantissa, exponent} =
      case String.split(String.downcase(text), "e") do
        [mantissa] -> {mantissa, 0}
        [mantissa, exponent] -> {mantissa, String.to_integer(exponent)}
      end

    {sign, digits} =
      case mantissa do
        "-" <> digits -> {"-", digits}
        "+" <> digits -> {"", digits}
        digits -> {"", digits}
      end

    [whole | part] = String.split(digits, ".")
    whole = if whole == "", do: "0", else: whole
    part = if part in [[], [""]], do: "0", else: hd(part)

    # With a greater exponent the number is out of range, with a lower one it is zero, whatever
    # its digits.
    cond do
      exponent > 40 -> if String.match?(digits, ~r/[1-9]/), do: :too_large, else: 0.0
      exponent < -60 -> 0.0
      true -> String.to_float("#{sign}#{whole}.#{part}e#{exponent}")
    end
  end

  defp in_range(number) when is_float(number) and abs(number) <= @greatest, do: {:ok, number}
  defp in_range(_number), do: {:error, "a number from -1000000 to 1000000"}
end
