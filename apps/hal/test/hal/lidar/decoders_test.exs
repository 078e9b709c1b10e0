defmodule Hal.Lidar.DecodersTest do
  use ExUnit.Case, async: true
  alias Hal.Lds
  alias Hal.RPLidar
  alias Hal.RPLidar.Nodes

  doctest Hal.RPLidar
  doctest Hal.RPLidar.Nodes
  doctest Hal.RPLidar.Driver
  doctest Hal.Lds
  doctest Hal.Lds.Driver
  doctest Hal.Lidar.Turn

  # A capsule at this angle (degrees) whose 32 measurements have this offset (1/8 degree) and these millimetres.
  defp capsule(degrees, offset, mm, first? \\ false) do
    word = fn mm -> <<Bitwise.bsl(mm, 2) + div(offset, 16)::16-little>> end

    cabins =
      for _ <- 1..16, into: <<>>, do: word.(mm) <> word.(mm + 1) <> <<rem(offset, 16) * 17>>

    body = <<degrees * 64 + if(first?, do: 0x8000, else: 0)::16-little, cabins::binary>>
    sum = RPLidar.xor(body)
    <<0xA0 + rem(sum, 16), 0x50 + div(sum, 16), body::binary>>
  end

  test "a capsule is decoded when the next one comes, its angles spread between the two and moved by their offsets" do
    nodes = Nodes.new(0x82)
    assert {[], nodes} = Nodes.take(nodes, capsule(10, 8, 500, true))
    {measured, _nodes} = Nodes.take(nodes, capsule(42, 0, 500))
    assert length(measured) == 32
    # 32 degrees for 32, one degree off.
    assert for({first?, angle, _mm} <- measured, do: {first?, angle / 64}) ==
             for(k <- 0..31, do: {false, 9.0 + k})

    assert for({_, _, mm} <- Enum.take(measured, 3), do: mm) == [500, 501, 500]
  end

  test "at the end of a turn one measurement is marked" do
    {_, nodes} = Nodes.take(Nodes.new(0x82), capsule(340, 0, 500))
    {measured, _} = Nodes.take(nodes, capsule(12, 0, 500))
    # As the maker's program has it, the last one before the end is marked.
    marked = for {{true, angle, _}, k} <- Enum.with_index(measured), do: {k, div(angle, 64)}
    assert marked == [{19, 359}]
  end

  test "nothing is interpolated over a gap, a bad packet or a new stream" do
    <<head, mid, rest::binary>> = bad = capsule(42, 0, 500)

    bad =
      binary_part(bad, 0, 50) <>
        <<Bitwise.bxor(:binary.at(bad, 50), 1)>> <> binary_part(bad, 51, 33)

    for between <- [bad, binary_part(capsule(42, 0, 500), 0, 80), <<head, mid>>] do
      {measured, _} =
        Nodes.take(
          Nodes.new(0x82),
          capsule(10, 0, 500) <> between <> capsule(74, 0, 500) <> capsule(106, 0, 500)
        )

      assert length(measured) == 32
      assert {_, 4736, 500} = hd(measured)
    end

    assert {[], _} = Nodes.take(Nodes.new(0x82), capsule(10, 0, 500) <> capsule(42, 0, 500, true))
    assert {[], _} = Nodes.take(Nodes.new(0x82), capsule(10, 0, 500) <> capsule(200, 0, 500))
    assert byte_size(rest) == 82
  end

  test "a stream comes in any pieces" do
    stream = for k <- 0..40, into: <<>>, do: capsule(rem(k * 32, 360), rem(k, 32), 300 + k)
    {whole, _} = Nodes.take(Nodes.new(0x82), stream)

    {pieces, _} =
      Enum.flat_map_reduce(
        for(<<byte <- stream>>, do: <<byte>>),
        Nodes.new(0x82),
        &Nodes.take(&2, &1)
      )

    assert pieces == whole
    assert length(whole) == 40 * 32
  end

  test "noise neither crashes a decoder nor makes its buffer grow" do
    rand = :rand.seed_s(:exsss, 7)

    for type <- Nodes.types(), reduce: rand do
      rand ->
        {_nodes, rand} =
          for _ <- 1..200, reduce: {Nodes.new(type), rand} do
            {nodes, rand} ->
              {bytes, rand} = :rand.bytes_s(97, rand)
              {_measured, nodes} = Nodes.take(nodes, bytes)
              assert byte_size(nodes.buffer) < 84
              {nodes, rand}
          end

        rand
    end

    for model <- [:lds01, :lds02] do
      {bytes, _} = :rand.bytes_s(20_000, rand)

      assert {[], rest} =
               Lds.cut(model, :binary.replace(bytes, <<0x54, 0x2C>>, <<0, 0>>, [:global]))

      assert byte_size(rest) < 47
    end
  end

  test "packets of an LDS whose checksum or whose angles do not fit are left out" do
    points = :binary.copy(<<1_000::16-little, 9>>, 12)

    packet = fn first, last ->
      body =
        <<0x54, 0x2C, 1800::16-little, first::16-little, points::binary, last::16-little, 0::16>>

      body <> <<Lds.crc(body)>>
    end

    assert {[[{359.0, 1000}, {360.0, 1000} | _] = twelve], <<>>} =
             Lds.cut(:lds02, packet.(35_900, 1_000))

    assert length(twelve) == 12
    assert {[], <<>>} = Lds.cut(:lds02, packet.(0, 9_000))
    <<first, rest::binary>> = packet.(0, 1_100)
    assert {[_], <<>>} = Lds.cut(:lds02, <<first>> <> <<first, rest::binary>>)
    <<whole::binary-size(20), byte, more::binary>> = packet.(0, 1_100)
    assert {[], _} = Lds.cut(:lds02, <<whole::binary, Bitwise.bxor(byte, 4), more::binary>>)
  end
end
