defmodule Lab.Node.LogTest do
  use ExUnit.Case, async: true
  alias Lab.Node.Log

  @moduletag :tmp_dir

  @doc false
  def count(counter), do: :atomics.add_get(counter, 1, 1)
  @doc false
  def same, do: {:as, "ever"}

  defp read(folder, offsets, lines, until) do
    {news, offsets} = Log.read(folder, [:mag1, :nobody], offsets)
    lines = lines ++ news

    if until.(lines),
      do: {lines, offsets},
      else: receive(do: (:never -> :ok), after: (10 -> read(folder, offsets, lines, until)))
  end

  defp values(lines, kind), do: for({_us, :mag1, ^kind, value} <- lines, do: value)

  test "what is noted and what changes is read while it is written", %{tmp_dir: folder} do
    me = self()
    counter = :atomics.new(1, [])

    looks = [
      {:count, 2, :always, {__MODULE__, :count, [counter]}},
      {:same, 1, :change, {__MODULE__, :same, []}}
    ]

    start_supervised!({Log, {folder, :mag1, looks, fn -> send(me, :begun) end}})
    assert_received :begun
    before = Log.now()
    :ok = Log.note(:word, "ä\n.")
    :ok = Log.note(:word, "ä\n.")
    for value <- [1, 1, nil, nil, 1], do: :ok = Log.change(:state, value)

    {lines, offsets} = read(folder, %{}, [], &(length(values(&1, :count)) >= 3))
    assert [{_us, :mag1, :boot, pid} | _] = lines
    assert pid == System.pid()
    assert values(lines, :word) == ["ä\n.", "ä\n."]
    assert values(lines, :state) == [1, nil, 1]
    assert values(lines, :same) == [{:as, "ever"}]
    assert Enum.take(values(lines, :count), 3) == [1, 2, 3]
    assert Enum.all?(for({us, _, :word, _} <- lines, do: us), &(&1 >= before))

    # Nothing is read twice, and what is read at once is sorted by time.
    stop_supervised!(Log)
    {rest, offsets} = Log.read(folder, [:mag1], offsets)
    assert values(rest, :word) == []
    {all, _offsets} = Log.read(folder, [:mag1], %{})
    assert Enum.sort(all) == Enum.sort(lines ++ rest)
    times = for {us, _who, _kind, _value} <- all, do: us
    assert times == Enum.sort(times)
    assert {[], ^offsets} = Log.read(folder, [:mag1], offsets)
  end

  test "half a line of a node that was killed, and what its next life adds to it, is left out",
       %{tmp_dir: folder} do
    path = Path.join(folder, "mag1.log")
    File.write!(path, "{1,mag1,claim,on}.\n{2,mag1,cl{3,mag1,boot,\"7\"}.\n{4,mag1,claim,of")
    assert {[{1, :mag1, :claim, :on}], offsets} = Log.read(folder, [:mag1], %{})
    File.write!(path, "f}.\n", [:append])
    assert {[{4, :mag1, :claim, :off}], _offsets} = Log.read(folder, [:mag1], offsets)
  end
end
