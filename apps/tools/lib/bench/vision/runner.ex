defmodule Bench.Vision.Runner do
  @moduledoc false
  # Measures the ways of `Bench.Vision` in rounds: in each round each way searches all copies of a
  # frame, one way after the other, so that a disturbance meets all of them. Slow ways take part in
  # each fourth round, for a short time.
  #
  # A round's figure is the median of its frames. Times are microseconds.
  alias Bench.Vision.Beside
  alias Vision.Backend.Native

  @slow_each 4
  @slow_us 300_000

  @typedoc "The figures of a way in each round that it took part in, or why there are none."
  @type result :: {:ok, %{(round :: non_neg_integer()) => figure()}} | {:absent, String.t()}
  @type figure :: %{us: float(), faults: float() | nil}

  @doc """
  Measures so many rounds; `note` is called before each. `programs` are the ways that other programs carry out; `folder` is for
  the files that they read.
  """
  @spec run(
          Bench.Vision.work(),
          [Bench.Vision.way()],
          %{atom() => Beside.program() | nil},
          Path.t(),
          pos_integer(),
          (round :: non_neg_integer() -> term())
        ) :: %{atom() => result()}
  def run(work, ways, programs, folder, rounds, note) do
    arguments = if Enum.any?(programs, &elem(&1, 1)), do: Beside.write(folder, work), else: []
    context = %{work: work, scratch: Vision.scratch(work.colours, Native), arguments: arguments}

    {present, absent} =
      ways
      |> Enum.map(&{&1, search(&1.name, programs[&1.name], context)})
      |> Enum.split_with(&match?({_way, search} when is_function(search), &1))

    # The first round makes memory and code warm.
    for round <- 0..rounds, reduce: results(present, absent) do
      results ->
        note.(round)
        measured = for {way, search} <- present, part?(way, round), do: {way.name, search.()}
        if round == 0, do: results, else: Enum.reduce(measured, results, &add(&1, round, &2))
    end
  end

  defp results(present, absent) do
    for({way, _search} <- present, into: %{}, do: {way.name, {:ok, %{}}})
    |> Map.merge(for {way, why} <- absent, into: %{}, do: {way.name, {:absent, why}})
  end

  defp part?(%{pace: :fast}, _round), do: true
  defp part?(%{pace: :slow}, round), do: rem(round, @slow_each) == 1

  defp add({name, {:error, why}}, _round, results), do: %{results | name => {:absent, why}}

  defp add({name, figure}, round, results) do
    case results[name] do
      {:ok, figures} -> %{results | name => {:ok, Map.put(figures, round, figure)}}
      {:absent, _why} -> results
    end
  end

  # What measures a way once, or why it cannot be measured.
  defp search(:copy, _program, %{work: work}),
    do: kernel(fn -> %{timed(fn -> Bench.Vision.Kernel.copy(work.copies) end) | faults: nil} end)

  defp search(:kernel, _program, %{work: %{colours: colours} = work}) do
    [%{width: width, height: height} | _] = work.frames

    kernel(fn ->
      timed(fn ->
        found =
          Bench.Vision.Kernel.find(work.copies, width, height, colours.tables, colours.min_area)

        Enum.map(found, &elem(&1, 0))
      end)
    end)
  end

  defp search(:call, _program, %{work: work, scratch: {Native, scratch}}),
    do: in_vm(work, &Native.regions(&1, work.colours, scratch))

  defp search(:alone, _program, %{work: work}),
    do: in_vm(work, &Native.regions(&1, work.colours))

  defp search(:blobs, _program, %{work: work, scratch: scratch}),
    do: in_vm(work, &Vision.blobs(&1, work.colours, Native, scratch))

  defp search(:evision, _program, %{work: work}), do: backend(Vision.Backend.Evision, work)
  defp search(:nx, _program, %{work: work}), do: backend(Vision.Backend.Nx, work)
  defp search(_program, nil, _context), do: "not here"

  defp search(_name, program, %{arguments: arguments}) do
    fn ->
      with {:ok, times} <- Beside.run(program, arguments), do: %{us: median(times), faults: nil}
    end
  end

  defp kernel(search), do: if(Bench.Vision.Kernel.loaded?(), do: search, else: "not built")

  defp backend(backend, work) do
    if Code.ensure_loaded?(backend) and backend.reads?(:yuyv),
      do: in_vm(work, &backend.regions(&1, work.colours)),
      else: "not here"
  end

  defp in_vm(work, search), do: fn -> timed(fn -> each(work.frames, search, 0, []) end) end

  # A slow way does not search all of them.
  defp each([], _search, _spent_us, times), do: times
  defp each(_frames, _search, spent_us, times) when spent_us > @slow_us * 1000, do: times

  defp each([frame | frames], search, spent, times) do
    begun = :erlang.monotonic_time(:nanosecond)
    {:ok, _found} = search.(frame)
    time = :erlang.monotonic_time(:nanosecond) - begun
    each(frames, search, spent + time, [time | times])
  end

  defp timed(search) do
    before = faults()
    times = search.()
    faults = if before, do: (faults() - before) / length(times)
    %{us: median(times) / 1000, faults: faults}
  end

  # Of all threads of this VM: the tenth field of proc(5)'s stat, after the name in brackets.
  defp faults do
    with {:ok, text} <- File.read("/proc/self/stat"),
         fields = text |> String.split(") ") |> List.last() |> String.split(" "),
         {faults, ""} <- fields |> Enum.at(7, "") |> Integer.parse(),
         do: faults,
         else: (_unknown -> nil)
  end

  defp median(times), do: Bench.Table.quantile(times, 0.5)
end
