defmodule Vision.Saver.Options do
  @moduledoc "The options of `Vision.Saver` that people give, which lists them. Pure."

  @defaults [rate: 1.0, files: 1_000, megabytes: 100]
  @keys [:folder | Keyword.keys(@defaults)]

  @doc """
  The options with their defaults, or what is wrong with the first wrong one.

      iex> Vision.Saver.Options.check(folder: "/tmp")
      {:ok, [rate: 1.0, files: 1_000, megabytes: 100, folder: "/tmp"]}
      iex> Vision.Saver.Options.check(folder: "/tmp", files: 0)
      {:error, "files cannot be 0: a whole number from 1 to 100000 is allowed"}
      iex> Vision.Saver.Options.check(rate: 1)
      {:error, "folder is missing"}
  """
  @spec check(term()) :: {:ok, keyword()} | {:error, line :: String.t()}
  def check(options) do
    if Keyword.keyword?(options),
      do: checked(options, Enum.find(options, fn {key, value} -> not valid?(key, value) end)),
      else:
        {:error, "#{shown(options)} is not a list of options such as [folder: \"/var/pictures\"]"}
  end

  defp checked(_options, {key, value}) when key in @keys,
    do: {:error, "#{key} cannot be #{shown(value)}: #{allowed(key)} is allowed"}

  defp checked(_options, {key, _value}),
    do: {:error, "there is no option #{inspect(key)}; there are #{Enum.join(@keys, ", ")}"}

  defp checked(options, nil) do
    if options[:folder],
      do: {:ok, Keyword.merge(@defaults, options)},
      else: {:error, "folder is missing"}
  end

  defp valid?(:folder, folder), do: is_binary(folder) and folder != ""
  defp valid?(:rate, rate), do: is_number(rate) and rate >= 0.001 and rate <= 30
  defp valid?(:files, files), do: files in 1..100_000
  defp valid?(:megabytes, megabytes), do: megabytes in 1..1_000_000
  defp valid?(_unknown, _value), do: false

  defp allowed(:folder), do: "the path of a folder"
  defp allowed(:rate), do: "a number from 0.001 to 30 pictures a second"
  defp allowed(:files), do: "a whole number from 1 to 100000"
  defp allowed(:megabytes), do: "a whole number from 1 to 1000000"

  defp shown(value), do: inspect(value, limit: 5, printable_limit: 80)
end
