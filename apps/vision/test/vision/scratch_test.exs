defmodule Vision.ScratchTest do
  @moduledoc "The memory that the native backend keeps from frame to frame."
  use ExUnit.Case, async: false
  alias Hal.Frame
  alias Vision.Backend.{Native, Reference}
  alias Vision.Colours

  # Neighbours are often of the same class, so that there are many regions of a few pixels.
  @levels [%{name: "dark", y: {0, 84}}, %{name: "light", y: {170, 255}}]

  setup_all do
    %{
      noise: noise(640, 480),
      calm: frame(640, 480, :binary.copy(<<128>>, 2 * 640 * 480)),
      colours: colours(20)
    }
  end

  defp colours(min_area) do
    any = %{u: {0, 255}, v: {0, 255}}
    {:ok, colours} = Colours.new(Enum.map(@levels, &Map.merge(&1, any)), min_area: min_area)
    colours
  end

  defp frame(width, height, bytes) do
    {:ok, frame} = Frame.new(:yuyv, width, height, bytes, 0)
    frame
  end

  defp noise(width, height), do: frame(width, height, :rand.bytes(2 * width * height))

  test "frames of differing size and format, one after the other, get the reference's answer" do
    scratch = Native.scratch()

    for _ <- 1..300 do
      format = Enum.random([:yuyv, :i420, :nv12])
      {width, height} = {2 * :rand.uniform(24), 2 * :rand.uniform(12)}
      {:ok, size} = Frame.byte_size(format, width, height)
      levels = :rand.uniform(4)
      bytes = for _ <- 1..size, into: <<>>, do: <<64 * :rand.uniform(levels) - 1>>
      {:ok, frame} = Frame.new(format, width, height, bytes, 0)
      colours = colours(:rand.uniform(4))
      assert Native.regions(frame, colours, scratch) == Reference.regions(frame, colours)
    end
  end

  test "it grows once, and shrinks when many frames did not need it", context do
    %{noise: noise, calm: calm, colours: colours} = context
    scratch = Native.scratch()
    assert Native.held(scratch) == 0
    {:ok, _none} = Native.regions(calm, colours, scratch)
    rows = Native.held(scratch)
    assert rows in 1..(640 * 46 + 9_000)

    answer = Native.regions(noise, colours)
    assert Native.regions(noise, colours, scratch) == answer
    grown = Native.held(scratch)
    assert grown > 20 * rows and grown <= rows + 640 * 480 * 96

    # One noisy frame now and then keeps it.
    for _ <- 1..3 do
      for _ <- 1..40, do: {:ok, []} = Native.regions(calm, colours, scratch)
      assert Native.regions(noise, colours, scratch) == answer
      assert Native.held(scratch) == grown
    end

    for _ <- 1..128, do: {:ok, []} = Native.regions(calm, colours, scratch)
    assert Native.held(scratch) < 2 * rows
    assert Native.regions(noise, colours, scratch) == answer
  end

  test "a frame that takes long is finished elsewhere, and found the same" do
    scratch = Native.scratch()
    colours = colours(1)

    for size <- [1200, 64, 1000, 2, 800] do
      frame = noise(size, size)
      {:ok, found} = Native.regions(frame, colours)
      assert Native.regions(frame, colours, scratch) == {:ok, found}
      assert size < 800 or length(found) > 100_000
    end
  end

  test "processes that share one at a time all get their own answers", %{colours: colours} do
    scratch = Native.scratch()

    1..8
    |> Task.async_stream(fn n ->
      frame = noise(20 * n, 30)
      answer = Native.regions(frame, colours)
      for _ <- 1..300, do: assert(Native.regions(frame, colours, scratch) == answer)
    end)
    |> Enum.each(fn {:ok, _all} -> :ok end)

    assert is_integer(Native.held(scratch))
  end

  test "a process that is killed while it looks does not hold up the others", context do
    scratch = Native.scratch()
    frame = noise(2000, 2000)
    answer = Native.regions(context.noise, context.colours)

    for _ <- 1..10 do
      pid = spawn(fn -> for _ <- 1..100, do: Native.regions(frame, context.colours, scratch) end)
      await_use(scratch)
      Process.exit(pid, :kill)
      assert Native.regions(context.noise, context.colours, scratch) == answer
    end
  end

  defp await_use(scratch),
    do: unless(Native.held(scratch) == {:error, :in_use}, do: await_use(scratch))

  test "what is no scratch is refused", %{calm: calm, colours: colours} do
    for wrong <- [make_ref(), :scratch, 1, "", self(), :atomics.new(1, [])] do
      assert_raise ArgumentError, fn -> Native.regions(calm, colours, wrong) end
      assert_raise ArgumentError, fn -> Native.held(wrong) end
    end

    assert Native.regions(calm, colours, nil) == {:ok, []}
  end

  test "it outlives a new version of the module", context do
    scratch = Native.scratch()
    answer = Native.regions(context.noise, context.colours, scratch)
    held = Native.held(scratch)

    for _ <- 1..2 do
      :code.purge(Native)
      {:module, Native} = :code.load_file(Native)
      assert Native.held(scratch) == held
      assert Native.regions(context.noise, context.colours, scratch) == answer
      assert Native.regions(context.noise, context.colours, Native.scratch()) == answer
    end
  end

  @tag if(File.exists?("/proc/self/status"), do: [], else: [skip: "no /proc"])
  test "its memory goes with the process that made it", context do
    look = fn ->
      Task.await(
        Task.async(fn ->
          scratch = Native.scratch()
          {:ok, _found} = Native.regions(context.noise, context.colours, scratch)
          Native.held(scratch)
        end)
      )
    end

    held = look.()
    before = resident()
    for _ <- 1..100, do: assert(look.() == held)
    assert held > 1_000_000
    # A quarter of what they held together.
    assert resident() - before < 25 * held
  end

  defp resident do
    [_line, kilobytes] = Regex.run(~r/VmRSS:\s+(\d+)/, File.read!("/proc/self/status"))
    1024 * String.to_integer(kilobytes)
  end
end
