defmodule Hal.Visca.SessionTest do
  use ExUnit.Case, async: true
  alias Hal.ViscaToy
  alias Hal.Visca.Session
  doctest Hal.Visca.Session
  doctest Hal.Visca.Session.Target
  doctest Hal.Visca.Session.OutlierFilter

  @degree :math.pi() / 180
  @looks <<0x81, 0x01, 0x06, 0x02>>

  # A head and a toy camera on one line, a millisecond at a time. `wire` spoils what passes.
  defp start(options \\ []) do
    {toy, options} = Keyword.pop(options, :toy, %ViscaToy{})
    {wire, options} = Keyword.pop(options, :wire, fn bytes -> bytes end)
    {effects, head} = Session.open(options, 0)

    carry_out(effects, %{
      head: head,
      toy: toy,
      wire: wire,
      now_ms: 0,
      seen: [],
      off: [],
      told: [],
      error: nil
    })
  end

  defp run(state, ms), do: Enum.reduce(1..ms//1, state, fn _, state -> step(state) end)

  defp step(%{error: error} = state) when error != nil, do: state

  defp step(state) do
    now_ms = state.now_ms + 1
    {said, toy} = ViscaToy.step(state.toy)
    state = %{state | now_ms: now_ms, toy: toy}

    state =
      case state.wire.(said) do
        "" -> state
        bytes -> put(state, Session.bytes(state.head, bytes, now_ms))
      end

    wake_ms = Session.wake_ms(state.head)

    if state.error == nil and wake_ms != nil and wake_ms <= now_ms,
      do: put(state, Session.tick(state.head, now_ms)),
      else: state
  end

  defp look(state, pan, tilt \\ 0.0),
    do: put(state, Session.look(state.head, pan, tilt, state.now_ms))

  defp put(state, {effects, head}), do: carry_out(effects, %{state | head: head})

  defp carry_out(effects, state) do
    Enum.reduce(effects, state, fn
      {:write, bytes}, state ->
        %{state | toy: ViscaToy.hear(state.toy, state.wire.(bytes))}

      {:reading, {what, _, _} = reading}, state when what == :refused ->
        %{state | told: [reading | state.told]}

      {:reading, {what, _} = reading}, state when what in [:obeyed, :odd] ->
        %{state | told: [reading | state.told]}

      {:reading, {:ptz, %{pan: pan}} = reading}, state ->
        off = abs(pan / @degree + elem(state.toy.at, 0) / 8.8)
        %{state | seen: [{state.now_ms, reading} | state.seen], off: [off | state.off]}

      {:error, reason}, state ->
        %{state | error: reason}
    end)
  end

  defp now_at(state) do
    [{_ms, {:ptz, %{pan: pan, tilt: tilt}}} | _] = state.seen
    {pan / @degree, tilt / @degree}
  end

  defp said(state, prefix),
    do:
      for(
        {ms, bytes} <- Enum.reverse(state.toy.heard),
        String.starts_with?(bytes, prefix),
        do: ms
      )

  test "opens, says where it is ten times a second, and goes where it is told" do
    state = run(start(), 1_000)
    assert_in_delta length(state.seen), 9, 1
    assert [{_, {:ptz, reading}} | _] = state.seen
    assert %{age_ms: age_ms, field_of_view: view} = reading
    assert_in_delta view, 48.8 * @degree, 1.0e-6
    assert age_ms in 5..20

    state = state |> look(30 * @degree, -10 * @degree) |> run(600)
    assert state.toy.at == {-264, -120}
    {pan, tilt} = now_at(state)
    assert_in_delta pan, 30, 0.06
    assert_in_delta tilt, -10, 0.05

    order = state.toy.heard |> Enum.reverse() |> Enum.map(&elem(&1, 1)) |> Enum.take(4)

    assert order == [
             <<0x88, 0x30, 0x01>>,
             <<0x88, 0x01, 0, 0x01>>,
             <<0x81, 0x09, 0, 0x02>>,
             <<0x81, 0x09, 0x04, 0>>
           ]
  end

  test "what it was told while opening is done after it; the same again is not said" do
    state = start() |> look(0.5) |> run(1_500)
    assert_in_delta elem(now_at(state), 0), 0.5 / @degree, 0.06
    state = Enum.reduce(1..20, state, fn _, state -> state |> look(0.5) |> run(100) end)
    assert [_once] = said(state, @looks)
  end

  test "tracking at 10 Hz never queues up behind a slow camera, and ends at the last target" do
    # A position each 100 ms; with 90 ms for each answer a target, a cancel and a position take turns.
    for {slow, delay_ms, least} <- [{1.0, 16, 100}, {0.05, 16, 100}, {0.3, 90, 35}] do
      state = run(start(toy: %ViscaToy{slow: slow, delay_ms: delay_ms}), 1_500)

      {state, worst} =
        Enum.reduce(1..100, {state, 0}, fn k, {state, worst} ->
          state = state |> look(0.8 * :math.sin(k / 10)) |> run(100)
          {state, max(worst, length(state.head.queue.waiting))}
        end)

      assert worst <= 3
      last = Hal.Visca.Units.pan(0.8 * :math.sin(100 / 10))
      # The last one is on its way, or was said: nothing older comes after it.
      state = run(state, 1_000)
      <<_, _, _, _, _, _, a, b, c, d, _::binary>> = newest_look(state)
      assert <<a::4, b::4, c::4, d::4>> == <<last::16>>
      # The readings go on meanwhile.
      ages = state.seen |> Enum.map(&elem(&1, 0)) |> Enum.chunk_every(2, 1, :discard)
      assert Enum.all?(ages, fn [late, early] -> late - early <= 400 end)
      assert length(state.seen) >= least
    end
  end

  defp newest_look(state) do
    Enum.find_value(state.toy.heard, fn {_ms, bytes} ->
      String.starts_with?(bytes, @looks) && bytes
    end)
  end

  test "a camera that is off is switched on; one that is switched off meanwhile is too" do
    state = start(toy: %ViscaToy{on?: false}) |> look(0.3) |> run(1_500)
    assert state.toy.on?
    assert_in_delta elem(now_at(state), 0), 0.3 / @degree, 0.06

    state = %{state | toy: %{state.toy | on?: false, at: {0, 0}, work: %{}}}
    state = run(state, 2_500)
    assert state.error == nil
    assert state.toy.on?
    assert_in_delta elem(now_at(state), 0), 0.3 / @degree, 0.06
  end

  test "a camera that was switched off and on says so, is opened again and told its target" do
    state = start() |> look(0.3) |> run(1_500)
    again = %ViscaToy{now_ms: state.toy.now_ms, out: [{0, <<0x90, 0x38, 0xFF>>}]}
    state = run(%{state | toy: again}, 1_500)
    assert [_] = said(state, <<0x88, 0x30>>)
    assert [_] = said(state, <<0x88, 0x01>>)
    assert_in_delta elem(now_at(state), 0), 0.3 / @degree, 0.06
    # One that does not say so stands elsewhere than it should.
    state = run(%{state | toy: %{again | now_ms: state.toy.now_ms, out: []}}, 3_000)
    assert_in_delta elem(now_at(state), 0), 0.3 / @degree, 0.06
  end

  test "silence is an error after a second, at the opening and later" do
    dead = %ViscaToy{lose: fn _ -> true end}
    state = run(start(toy: dead), 1_500)
    assert {state.error, state.now_ms} == {:no_answer, 1_000}

    state = run(start(), 700)
    state = run(%{state | toy: %{state.toy | lose: fn _ -> true end}}, 1_500)
    assert state.error == :no_answer
    assert state.now_ms in 1_600..1_900
  end

  test "a camera that answers, but no more to where it looks, is silent too" do
    no_position = fn bytes -> byte_size(bytes) == 11 end
    state = run(start(toy: %ViscaToy{lose: no_position}), 3_000)
    assert state.error == :no_answer
  end

  test "no answer to the calls to all is no reason to give up; the wrong camera is" do
    deaf = fn bytes -> match?(<<0x88, _::binary>>, bytes) end
    state = run(start(toy: %ViscaToy{lose: deaf}), 2_000)
    assert {state.error, length(state.seen) > 5} == {nil, true}
    assert run(start(camera: 2), 500).error == {:cameras, 1}
  end

  test "a model of unknown units is refused, by what it says twice; the file may name one" do
    for code <- [0x0411, 0x0412, 0x0510, 0x0401],
        do: assert(run(start(toy: %ViscaToy{model: code}), 500).error == {:model, code})

    state = run(start(toy: %ViscaToy{model: 0x0510}, model: :d30), 1_000)
    assert {state.error, state.seen != []} == {nil, true}

    assert state.told == [
             odd:
               "it says that it is a camera of the unknown model 0x0510, and is taken for an EVI-D30, because of model: in its file"
           ]

    assert run(start(toy: %ViscaToy{}, model: :d30), 1_000).told == []
  end

  test "a camera that refuses to say its model is refused, unless the file names it; one that is off may be" do
    mum = fn bytes -> match?(<<0x81, 0x09, 0, 2>>, bytes) end
    assert run(start(toy: %ViscaToy{refuse: mum}), 3_000).error == {:model, nil}
    state = run(start(toy: %ViscaToy{refuse: mum}, model: :d30), 1_000)
    assert {state.error, state.seen != []} == {nil, true}
  end

  test "a D70 and a D100 are driven in their own units" do
    ends = {-2267..2267, -400..1200}
    state = start(toy: %ViscaToy{model: 0x040E, ends: ends}) |> look(150 * @degree, 80 * @degree)
    state = run(state, 5_000)
    assert state.toy.at == {-2000, 1067}
    {pan, tilt} = now_at(state)
    assert_in_delta pan, 150, 0.1
    assert_in_delta tilt, 80, 0.1
    assert [{_, {:ptz, %{field_of_view: view}}} | _] = state.seen
    assert_in_delta view / @degree, 48, 0.01

    ends = {-1440..1440, -360..360}
    state = start(toy: %ViscaToy{model: 0x040D, ends: ends}, field_of_view: 6.6 * @degree)
    state = state |> look(90 * @degree, -20 * @degree) |> run(4_000)
    assert {state.toy.at, state.toy.zoom} == {{-1296, -288}, 0x4000}
  end

  test "an answer from another address, and numbers that the model cannot have, are told as these" do
    assert run(start(toy: %ViscaToy{address: 2}), 2_000).error == {:address, 2}
    assert run(start(toy: %ViscaToy{zoom: 0x2000}), 2_000).error == {:zoom, 0x2000, :d30}
    assert run(start(toy: %ViscaToy{at: {1200, 0}}), 4_000).error == {:position, 1200, 0, :d30}

    state = run(start(), 1_000)
    state = run(put_in(state.toy.zoom, 0x400), 3_000)
    assert state.error == {:zoom, 0x400, :d30}
  end

  test "what the camera refuses is told, each time, and what it does" do
    looks? = fn bytes -> match?(<<@looks, _::binary>>, bytes) end
    state = start(toy: %ViscaToy{refuse: looks?}) |> look(0.5) |> run(6_000)
    assert state.error == nil
    assert length(state.told) in 3..6
    line = "it does not know the command (syntax error)"
    assert Enum.uniq(state.told) == [{:refused, :look, line}]

    state = run(put_in(state.toy.refuse, nil), 3_000)
    assert hd(state.told) == {:obeyed, :look}

    zooms? = fn bytes -> match?(<<0x81, 0x01, 0x04, 0x47, _::binary>>, bytes) end
    state = run(start(toy: %ViscaToy{refuse: zooms?}, field_of_view: 0.3), 3_000)
    assert state.told == [{:refused, :zoom, line}]
  end

  test "a camera that cannot be opened, although it answers, says at what: within 9 s" do
    for {wrong, toy, step, line} <- [
          {<<0x81, 0x01, 0x04, 0, 2>>, %ViscaToy{on?: false}, :switch_on, "it does not know"},
          {<<0x81, 0x09, 0x04, 0>>, %ViscaToy{}, :power, "the inquiry of its power"},
          {<<0x81, 0x09, 0x04, 0x47>>, %ViscaToy{}, :look_round, "the inquiry of its zoom"}
        ] do
      state = run(start(toy: %{toy | refuse: &(&1 == wrong)}), 9_500)
      assert {:opening, at, refusal} = state.error
      assert at in [step, :power]
      assert refusal =~ line
    end
  end

  test "a hand that turns it is answered, once a second at most" do
    state = start() |> look(0.0) |> run(1_500)
    shoved = fn state -> put_in(state.toy.at, {300, 0}) end
    state = run(shoved.(state), 3_000)
    assert_in_delta elem(now_at(state), 0), 0.0, 0.1
    assert length(said(state, @looks)) == 2
  end

  test "zooms, and tells the field of view that it has" do
    state = run(start(field_of_view: 20 * @degree), 2_000)
    assert [{_, {:ptz, %{field_of_view: view}}} | _] = state.seen
    assert_in_delta view / @degree, 20, 0.1
    state = run(put(state, Session.zoom(state.head, 48.8 * @degree, state.now_ms)), 1_000)
    assert [{_, {:ptz, %{field_of_view: view}}} | _] = state.seen
    assert_in_delta view / @degree, 48.8, 0.1
  end

  test "with 2 % of all bytes lost, doubled or flipped it still follows, and tells few wrong places" do
    {times, runs} = Enum.unzip(for _ <- 1..5, do: follow_on_a_bad_line())

    # One command in four is spoiled, and a wrong one is told again after a second: of 800 heads 791 came within one
    # second, 8 within two, one within three.
    assert Enum.count(times, &(&1 <= 1_000)) >= 3
    # How far what it says is from where the camera is: it is 20 ms old.
    off = Enum.concat(runs)
    assert length(off) > 250
    assert Enum.count(off, &(&1 > 5)) <= 0.02 * length(off)
  end

  defp follow_on_a_bad_line do
    state = run(start(wire: &spoil/1), 2_000)

    state =
      Enum.reduce(1..150, state, fn k, state ->
        state |> look(0.6 * :math.sin(k / 20)) |> run(100)
      end)

    assert state.error == nil
    off = state.off
    {state |> look(0.2) |> arrive(0), off}
  end

  # How long it takes, in ms, until it stays where it should be.
  defp arrive(_state, 10_000), do: flunk("it never gets there")

  defp arrive(state, ms) do
    if abs(elem(state.toy.at, 0) - Hal.Visca.Units.pan(0.2)) <= 9 and ms >= 1_000,
      do: ms,
      else: state |> run(100) |> arrive(ms + 100)
  end

  defp spoil(bytes) do
    for <<byte <- bytes>>, into: <<>> do
      case :rand.uniform(150) do
        1 -> <<>>
        2 -> <<byte, byte>>
        3 -> <<Bitwise.bxor(byte, Bitwise.bsl(1, :rand.uniform(8) - 1))>>
        _ -> <<byte>>
      end
    end
  end

  test "random buffers do not crash it, and cost bounded memory" do
    {_, head} = Session.open([], 0)

    Enum.reduce(1..20_000, head, fn k, head ->
      noise = for _ <- 1..:rand.uniform(8), into: <<>>, do: noise()
      {_effects, head} = Session.bytes(head, noise, k * 3)
      {_effects, head} = Session.tick(head, k * 3 + 1)
      {_effects, head} = Session.look(head, :rand.uniform() * 4 - 2, 0.0, k * 3 + 2)
      if rem(k, 1000) == 0, do: assert(:erts_debug.flat_size(head) < 1_000)
      head
    end)
  end

  defp noise do
    Enum.random([
      <<0x90, 0x41, 0xFF>>,
      <<0x90, 0x52, 0xFF>>,
      <<0x90, 0x50, 0, 0, 0, 0, 0xFF>>,
      <<0x90, 0x50, 0::64, 0xFF>>,
      <<0x90, 0x60, 3, 0xFF>>,
      <<0x90, 0x61, 4, 0xFF>>,
      <<0x88, 0x30, 2, 0xFF>>,
      <<0x88, 1, 0, 1, 0xFF>>,
      <<0x90, 0x50, 2, 0xFF>>,
      <<0x90, 0x38, 0xFF>>,
      <<:rand.uniform(256) - 1>>
    ])
  end
end
