defmodule Robot.Behaviour.Options do
  @moduledoc """
  Checks of the options that behaviours are made with: the option is named, and what is allowed. Pure.
  """

  @doc """
  The number of an option as a float, if it is a number within the range.

      iex> Robot.Behaviour.Options.number!([x: 2], :x)
      2.0
      iex> Robot.Behaviour.Options.number!([tolerance: -1], :tolerance, 0.0, 1.0)
      ** (ArgumentError) option tolerance cannot be -1: a number from 0.0 to 1.0 is allowed
  """
  @spec number!(keyword(), atom(), float(), float()) :: float()
  def number!(options, key, low \\ -1.0e6, high \\ 1.0e6) do
    case Keyword.fetch(options, key) do
      {:ok, value} when is_number(value) and value >= low and value <= high -> value * 1.0
      {:ok, value} -> refuse!(key, value, "a number from #{low} to #{high} is allowed")
      :error -> raise ArgumentError, "option #{key} is missing"
    end
  end

  @doc """
  Like `number!/4`, where `nil` is allowed as well.

      iex> Robot.Behaviour.Options.optional!([heading: nil], :heading)
      nil
  """
  @spec optional!(keyword(), atom(), float(), float()) :: float() | nil
  def optional!(options, key, low \\ -1.0e6, high \\ 1.0e6) do
    if is_nil(options[key]), do: nil, else: number!(options, key, low, high)
  end

  @doc """
  The value of an option if the check holds.

      iex> Robot.Behaviour.Options.check!([colour: "Red"], :colour, &is_binary/1, "a string")
      "Red"
  """
  @spec check!(keyword(), atom(), (term() -> boolean()), String.t()) :: term()
  def check!(options, key, check, allowed) do
    value = options[key]
    if check.(value), do: value, else: refuse!(key, value, "#{allowed} is allowed")
  end

  defp refuse!(key, value, allowed),
    do: raise(ArgumentError, "option #{key} cannot be #{inspect(value)}: #{allowed}")
end
