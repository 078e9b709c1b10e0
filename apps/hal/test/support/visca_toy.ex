defmodule Hal.ViscaToy do
  @moduledoc """
  As much of an EVI-D30 as the tests of its head need: bytes in, bytes out, in milliseconds. Pure.

  Fields to set: `at`, `zoom`, `on?`, `model`, `ends` (of pan and tilt), `address`, `delay_ms`, `slow`
  (its share of the full speed), `lose` (a function of a reply that says whether it gets lost),
  `refuse` (one of a message, that says whether it is a syntax error).
  """
  import Bitwise

  defstruct at: {0, 0},
            zoom: 0,
            on?: true,
            model: 0x0402,
            ends: {-880..880, -300..300},
            address: 1,
            refuse: nil,
            delay_ms: 16,
            slow: 1.0,
            rest: <<>>,
            work: %{},
            out: [],
            heard: [],
            now_ms: 0,
            lose: nil

  @doc "Bytes from the controller."
  def hear(toy, bytes) do
    {messages, [rest]} =
      (toy.rest <> bytes) |> :binary.split(<<0xFF>>, [:global]) |> Enum.split(-1)

    Enum.reduce(messages, %{toy | rest: rest}, &message/2)
  end

  @doc "One more millisecond; what it says now."
  def step(toy) do
    toy = Enum.reduce(toy.work, %{toy | now_ms: toy.now_ms + 1}, &work/2)
    {out, later} = Enum.split_with(toy.out, fn {at_ms, _} -> at_ms <= toy.now_ms end)
    lost? = toy.lose || fn _ -> false end
    said = for {_, bytes} <- Enum.reverse(out), not lost?.(bytes), into: <<>>, do: bytes
    {said, %{toy | out: later}}
  end

  defp message(bytes, toy) do
    toy = %{toy | heard: [{toy.now_ms, bytes} | toy.heard]}

    if toy.refuse && toy.refuse.(bytes),
      do: say(toy, <<0x90, 0x60, 0x02, 0xFF>>),
      else: obey(bytes, toy)
  end

  defp obey(<<0x88, 0x30, 0x01>>, toy), do: say(toy, <<0x88, 0x30, 0x02, 0xFF>>)

  defp obey(<<0x88, 0x01, 0, 0x01>>, toy),
    do: say(%{toy | work: %{}}, <<0x88, 0x01, 0, 0x01, 0xFF>>)

  defp obey(<<0x81, 0x09, 0, 2>>, toy),
    do: say(toy, <<0x90, 0x50, 0, 0x20, toy.model::16, 1, 0, 2, 0xFF>>)

  defp obey(<<0x81, 0x09, 0x04, 0>>, toy),
    do: say(toy, <<0x90, 0x50, if(toy.on?, do: 2, else: 3), 0xFF>>)

  defp obey(<<0x81, 0x01, 0x04, 0, p>>, toy),
    do: start(toy, {:power, p == 2, toy.now_ms + 300})

  defp obey(_other, %{on?: false} = toy), do: say(toy, <<0x90, 0x61, 0x41, 0xFF>>)

  defp obey(<<0x81, 0x09, 0x04, 0x47>>, toy),
    do: say(toy, <<0x90, 0x50, nibbles(toy.zoom)::binary, 0xFF>>)

  defp obey(<<0x81, 0x09, 0x06, 0x12>>, %{at: {pan, tilt}} = toy),
    do:
      say(
        toy,
        <<0x90, 0x50, nibbles(round(pan))::binary, nibbles(round(tilt))::binary, 0xFF>>
      )

  defp obey(<<0x81, 0x01, 0x06, 0x02, _v, _w, pan::binary-size(4), tilt::binary-size(4)>>, toy),
    do: look(toy, number(pan), number(tilt))

  defp obey(<<0x81, 0x01, 0x04, 0x47, zoom::binary-size(4)>>, toy),
    do: start(toy, {:zoom, number(zoom)})

  defp obey(<<0x81, 2::4, socket::4>>, toy) do
    {work, rest} = Map.pop(toy.work, socket)
    say(%{toy | work: rest}, <<0x90, 0x60 + socket, if(work, do: 4, else: 5), 0xFF>>)
  end

  defp obey(_wrong, toy), do: say(toy, <<0x90, 0x60, 0x02, 0xFF>>)

  defp look(%{ends: {pans, tilts}} = toy, pan, tilt) do
    if pan in pans and tilt in tilts,
      do: start(toy, {:look, pan, tilt}),
      else: say(toy, <<0x90, 0x60, 0x02, 0xFF>>)
  end

  defp start(toy, what) do
    case Enum.find([1, 2], &(not is_map_key(toy.work, &1))) do
      nil ->
        say(toy, <<0x90, 0x60, 0x03, 0xFF>>)

      socket ->
        say(
          %{toy | work: Map.put(toy.work, socket, {toy.now_ms, what})},
          <<0x90, 0x40 + socket, 0xFF>>
        )
    end
  end

  defp work({socket, {_since, {:zoom, zoom}}}, toy), do: finish(%{toy | zoom: zoom}, socket)

  defp work({socket, {_since, {:power, on?, at_ms}}}, toy),
    do: if(toy.now_ms >= at_ms, do: finish(%{toy | on?: on?}, socket), else: toy)

  defp work({socket, {since, {:look, pan, tilt}}}, %{at: {p, t}} = toy) do
    newest? =
      Enum.all?(toy.work, fn {_, {other, what}} -> elem(what, 0) != :look or other <= since end)

    # The newest look moves the head, and is the end of an older one.
    if newest? do
      at = {towards(p, pan, 0.704 * toy.slow), towards(t, tilt, 0.6 * toy.slow)}
      toy = %{toy | at: at}
      if at == {pan, tilt}, do: finish(toy, socket), else: toy
    else
      finish(toy, socket)
    end
  end

  defp finish(toy, socket),
    do: say(%{toy | work: Map.delete(toy.work, socket)}, <<0x90, 0x50 + socket, 0xFF>>)

  defp towards(from, to, most) when abs(to - from) <= most, do: to
  defp towards(from, to, most) when to > from, do: from + most
  defp towards(from, _to, most), do: from - most

  defp say(toy, <<0x90, rest::binary>>) when toy.address != 1,
    do: say(%{toy | address: 1}, <<0x80 + 16 * toy.address, rest::binary>>, toy.address)

  defp say(toy, bytes), do: %{toy | out: [{toy.now_ms + toy.delay_ms, bytes} | toy.out]}

  defp say(toy, bytes, address), do: %{say(toy, bytes) | address: address}

  defp nibbles(n) do
    <<a::4, b::4, c::4, d::4>> = <<n::16>>
    <<a, b, c, d>>
  end

  defp number(<<a, b, c, d>>) do
    <<n::signed-16>> = <<(a <<< 12) + (b <<< 8) + (c <<< 4) + d::16>>
    n
  end
end
