defmodule Mesh.Secret.Text do
  @moduledoc false
  # Judges whether the text of a secret file is good enough to protect a fleet. Pure.
  #
  # A good one is base64 or hex text of at least 32 random bytes. There is no proof that bytes are
  # random; this finds those that clearly are not: words, rows of keys, patterns, padding.
  import Bitwise

  @least 32
  @most 1_024
  @words ~w(cookie secret password passwort changeme example default convoy monster erlang elixir
            qwerty asdfgh zxcvbn letmein 123456 abcdef testtest)

  @doc """
  The bytes of a secret's text, or what is wrong with it, as the end of a sentence.

      iex> Mesh.Secret.Text.decode("cookie")
      {:error, "is too short (4 bytes; at least 32 are needed)"}
      iex> Mesh.Secret.Text.decode(String.duplicate("ab", 32))
      {:error, "is weak (it repeats itself)"}
  """
  @spec decode(String.t()) :: {:ok, binary()} | {:error, String.t()}
  def decode(text) do
    with {:ok, plain} <- plain(text),
         {:ok, bytes} <- bytes(plain),
         :ok <- sized(bytes),
         nil <- weakness(plain, bytes) do
      {:ok, bytes}
    else
      {:error, problem} -> {:error, problem}
      weakness -> {:error, "is weak (#{weakness})"}
    end
  end

  # base64 breaks its lines after 76 letters, and editors end files with a line of their own.
  defp plain(text) do
    case for <<byte <- text>>, byte not in ~c" \t\r\n", into: <<>>, do: <<byte>> do
      "" -> {:error, "is empty"}
      plain -> {:ok, plain}
    end
  end

  defp bytes(plain) do
    with :error <- Base.decode16(plain, case: :mixed),
         :error <- Base.decode64(plain, padding: false),
         :error <- Base.url_decode64(plain, padding: false) do
      {:error, "is not base64 or hex text"}
    end
  end

  defp sized(bytes) when byte_size(bytes) < @least,
    do: {:error, "is too short (#{byte_size(bytes)} bytes; at least #{@least} are needed)"}

  defp sized(bytes) when byte_size(bytes) > @most,
    do: {:error, "is too long (#{byte_size(bytes)} bytes; at most #{@most} are taken)"}

  defp sized(_bytes), do: :ok

  # None of these matches a random secret of 32 bytes more often than once in a hundred thousand.
  defp weakness(plain, bytes) do
    cond do
      word = Enum.find(@words, &String.contains?(String.downcase(plain), &1)) -> "it says #{word}"
      repeats?(plain) or repeats?(bytes) -> "it repeats itself"
      counts?(plain) or counts?(bytes) -> "it counts"
      distinct(bytes) < 20 -> "it has only #{distinct(bytes)} different bytes"
      words?(plain) -> "it is made of words"
      true -> nil
    end
  end

  # In random text hardly any group of three letters occurs twice.
  defp repeats?(bytes) do
    groups = for at <- 0..(byte_size(bytes) - 3)//1, do: binary_part(bytes, at, 3)
    length(Enum.uniq(groups)) < 0.7 * length(groups)
  end

  # The difference from byte to byte is always the same, as in `abcd…`.
  defp counts?(bytes) do
    list = :binary.bin_to_list(bytes)
    steps = Enum.zip_with(tl(list), list, fn next, byte -> next - byte &&& 0xFF end)
    most = steps |> Enum.frequencies() |> Map.values() |> Enum.max()
    most > 0.4 * length(steps)
  end

  defp distinct(bytes), do: bytes |> :binary.bin_to_list() |> Enum.uniq() |> length()

  # Random base64 mixes capitals and small letters; hex mixes letters and digits.
  defp words?(plain) do
    capitals = count(plain, ?A..?Z)
    small = count(plain, ?a..?z)
    digits = count(plain, ?0..?9)

    if String.match?(plain, ~r/\A[0-9a-fA-F]+\z/),
      do: digits == 0 or capitals + small == 0,
      else: min(capitals, small) < 4
  end

  defp count(plain, letters), do: length(for <<byte <- plain>>, byte in letters, do: byte)
end
