defmodule Mesh.Secret.TextTest do
  use ExUnit.Case, async: true
  alias Mesh.Secret.Text
  doctest Text

  test "random bytes are taken, in every spelling" do
    # The same bytes in every run: with others, two of 4,500 may say a word once in a thousand runs.
    :rand.seed(:exsss, {1, 2, 3})

    refused =
      for _ <- 1..500, size <- [32, 48, 64], bytes = :rand.bytes(size), spell <- spellings() do
        case Text.decode(spell.(bytes)) do
          {:ok, decoded} -> assert(decoded == bytes) && nil
          {:error, line} -> line
        end
      end
      |> Enum.reject(&is_nil/1)

    # One in a hundred thousand says a word by chance, such as 123456 in hex.
    assert length(refused) <= 1
    for line <- refused, do: assert(line =~ "is weak (it says ")
  end

  defp spellings do
    [
      &Base.encode64/1,
      &(Base.encode16(&1, case: :lower) <> "\n"),
      &Base.url_encode64(&1, padding: false)
    ]
  end

  test "lines that base64 has broken are put together" do
    bytes = :rand.bytes(64)
    <<first::binary-76, rest::binary>> = Base.encode64(bytes)
    assert {:ok, ^bytes} = Text.decode(first <> "\n" <> rest <> "\r\n")
  end

  test "what is plainly not random is weak" do
    for text <- [
          String.duplicate("A", 44),
          String.duplicate("cookie", 10),
          String.duplicate("xK9+", 11),
          Base.encode64(:binary.copy(:rand.bytes(8), 4)),
          Base.encode64(String.duplicate(<<0>>, 32)),
          Base.encode64(:rand.bytes(10) <> String.duplicate(<<0>>, 30)),
          Base.encode64(:binary.list_to_bin(Enum.to_list(0..31))),
          "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz",
          "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef",
          "thequickbrownfoxjumpsoverthelazydogandthensomemore12",
          "4815162342108481516234210848151623421084815162342108481516234210",
          "31415926535897932384626433832795028841971693993751058209749445923",
          "Convoy/" <> Base.encode64(:crypto.hash(:sha256, "z"), padding: false)
        ] do
      assert {:error, problem} = Text.decode(text), text
      assert problem =~ ~r"weak|is not base64|too short", text
    end
  end

  test "no text fells it" do
    for size <- 0..200, do: assert({_, _} = Text.decode(:rand.bytes(size)))
    assert {:error, "is too long" <> _rest} = Text.decode(Base.encode64(:rand.bytes(2_000)))
  end
end
