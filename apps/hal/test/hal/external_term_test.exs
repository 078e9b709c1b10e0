defmodule Hal.ExternalTermTest do
  use ExUnit.Case, async: true
  alias Hal.ExternalTerm
  doctest ExternalTerm

  @most 1_000_000

  defp term(0),
    do:
      Enum.random([
        &is_atom/1,
        1,
        -7,
        70_000,
        2 ** 70,
        1.5,
        nil,
        :ok,
        "text",
        <<1::3>>,
        [],
        {},
        ~c"ab",
        %{}
      ])

  defp term(depth) do
    some = fn -> for _ <- 1..Enum.random(1..4), do: term(depth - 1) end

    case Enum.random(1..5) do
      1 -> some.()
      2 -> List.to_tuple(some.())
      3 -> Map.new(some.(), &{&1, &1})
      4 -> [term(depth - 1) | term(0)]
      5 -> Map.new(1..Enum.random([3, 40]), &{&1, term(0)})
    end
  end

  # What a process that holds nothing else has on its heap, and beside it.
  defp memory(term), do: 8 * :erts_debug.flat_size(term)

  test "data is what it was, compressed or not, and what it takes in memory is not underestimated" do
    for _ <- 1..500,
        term = term(Enum.random(0..4)),
        options <- [[], [:compressed], [minor_version: 2]] do
      bytes = :erlang.term_to_binary(term, options)
      assert ExternalTerm.decode(bytes, @most) == {:ok, term}
      assert ExternalTerm.decodable?(term, @most)

      if memory(term) > 0, do: assert(ExternalTerm.decode(bytes, memory(term) - 1) == :error)
    end
  end

  test "a term that would take gigabytes is refused before it does" do
    nils = [<<131, 108, 200_000_000::32>>, :binary.copy(<<106>>, 1_000)]
    whole = :erlang.term_to_binary(:binary.copy(<<106>>, 50_000_000), [:compressed])
    <<131, 80, _size::32, deflated::binary>> = whole
    lies = <<131, 80, 1_000::32, deflated::binary>>
    <<131, list::binary>> = :erlang.term_to_binary(List.duplicate([], 1_000_000))
    z = :zlib.compress(list)
    bomb = <<131, 80, byte_size(list)::32, z::binary>>
    assert byte_size(bomb) < 2_000

    :erlang.garbage_collect()
    before = :erlang.memory(:total)

    for bytes <- [IO.iodata_to_binary(nils), whole, lies, bomb, <<131, 111, 0xFFFFFFFF::32, 0>>],
        do: assert(ExternalTerm.decode(bytes, 8_000_000) == :error)

    assert :erlang.memory(:total) - before < 50_000_000
  end

  test "what is no data, too deep, or no term is refused" do
    deep = Enum.reduce(1..300, [], fn _n, deep -> {deep} end)
    assert ExternalTerm.decode(:erlang.term_to_binary(deep), @most) == :error
    refute ExternalTerm.decodable?(deep, @most)

    for term <- [self(), make_ref(), fn -> 1 end, hd(Port.list()), 2 ** 300],
        do: assert(ExternalTerm.decode(:erlang.term_to_binary([term]), @most) == :error)

    for bytes <- [
          "",
          <<131>>,
          <<131, 80>>,
          <<131, 80, 5::32, 1, 2>>,
          <<131, 97>>,
          <<131, 97, 1, 2>>,
          <<131, 119, 7, "unheard">>
        ],
        do: assert(ExternalTerm.decode(bytes, @most) == :error)

    bytes = :erlang.term_to_binary(%{a: [1, {2.5, "x"}]})

    for at <- 0..(byte_size(bytes) - 1), byte <- 0..255 do
      <<head::binary-size(at), _, tail::binary>> = bytes
      result = ExternalTerm.decode(<<head::binary, byte, tail::binary>>, @most)
      assert result == :error or match?({:ok, _}, result)
    end
  end
end
