defmodule Hal.Visca.DriverTest do
  use ExUnit.Case, async: true
  import Hal.Lines, only: [far!: 1]
  alias Hal.{Device, Serial, ViscaToy}
  alias Hal.Visca.{Driver, Options}
  @moduletag :realtime
  doctest Hal.Visca.Options
  doctest Hal.Visca.Driver

  setup do
    Process.flag(:trap_exit, true)
    name = "visca_#{System.unique_integer([:positive])}_#{System.pid()}"
    folder = Path.join(System.tmp_dir!(), name)
    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    {:ok, link: Path.join(folder, "camera")}
  end

  defp device(link) do
    options = [kind: :ptz, driver: {Driver, port: link}, sinks: [{Kernel, :send, [self()]}]]
    start_supervised!({Device, options})
  end

  # The other end of a real pseudo-terminal, answered by the toy at the speed of the real clock.
  defp camera(link, toy \\ %ViscaToy{}) do
    far = far!(link)
    %{far: far, toy: toy, begun_ms: System.monotonic_time(:millisecond) - toy.now_ms}
  end

  # Plays the camera until a message for the test comes that the function wants.
  defp play(camera, wanted, left_ms \\ 20_000) do
    receive do
      message ->
        cond do
          match?({:data, _}, Serial.handle(camera.far, message)) ->
            {:data, bytes} = Serial.handle(camera.far, message)
            camera = catch_up(camera)
            play(%{camera | toy: ViscaToy.hear(camera.toy, bytes)}, wanted, left_ms)

          wanted.(message) ->
            {message, camera}

          true ->
            play(camera, wanted, left_ms)
        end
    after
      1 ->
        if left_ms == 0, do: flunk("the camera waited in vain")
        play(catch_up(camera), wanted, left_ms - 1)
    end
  end

  defp catch_up(%{toy: toy} = camera) do
    if camera.begun_ms + toy.now_ms < System.monotonic_time(:millisecond) do
      {said, toy} = ViscaToy.step(toy)
      if said != "", do: :ok = Serial.write(camera.far, said)
      catch_up(%{camera | toy: toy})
    else
      camera
    end
  end

  defp pan?(pan), do: &(match?({:ptz, _}, &1) and abs(elem(&1, 1).pan - pan) < 0.002)

  test "looks and tells, over a real line", %{link: link} do
    camera = camera(link)
    pid = device(link)
    since_ms = System.monotonic_time(:millisecond)
    Device.look(pid, 0.5, 0.1)
    {{:ptz, reading}, camera} = play(camera, pan?(0.5))
    assert_in_delta reading.tilt, 0.1, 0.01
    assert_in_delta reading.field_of_view, 0.8517, 1.0e-4
    # The bytes take some milliseconds on the line.
    assert reading.age_ms in 3..(System.monotonic_time(:millisecond) - since_ms)
    assert camera.toy.at == {-252, 69}
    Serial.close(camera.far)
  end

  test "a camera that falls silent is offline; replugged, it is told its last target", %{
    link: link
  } do
    camera = camera(link)
    pid = device(link)
    Device.look(pid, -0.4, 0.0)
    {_, camera} = play(camera, pan?(-0.4))

    silent = %{camera | toy: %{camera.toy | lose: fn _ -> true end}}
    {_, camera} = play(silent, &match?({:health, :ptz, {{:offline, :no_answer}, _}}, &1))

    again = %ViscaToy{now_ms: camera.toy.now_ms}
    {_, camera} = play(%{camera | toy: again}, pan?(-0.4))
    # What was on the line when it was closed may still come; then it is opened anew, and told.
    heard = camera.toy.heard |> Enum.reverse() |> Enum.map(&elem(&1, 1))
    opened = Enum.find_index(heard, &(&1 == <<0x88, 0x30, 0x01>>))
    cleared = Enum.find_index(heard, &(&1 == <<0x88, 0x01, 0x00, 0x01>>))
    told = Enum.find_index(heard, &match?(<<0x81, 0x01, 0x06, 0x02, _::binary>>, &1))
    assert Enum.all?([opened, cleared, told], &is_integer/1)
    assert opened < cleared and cleared < told
    Serial.close(camera.far)
  end

  test "a head that answers, and refuses every look, is not online; one that obeys again is", %{
    link: link
  } do
    looks? = fn bytes -> match?(<<0x81, 0x01, 0x06, 0x02, _::binary>>, bytes) end
    camera = camera(link, %ViscaToy{refuse: looks?})
    test = self()

    tell = fn _, measured, about, _ ->
      if about.driver == Driver, do: send(test, {:told, measured.count, about.line})
    end

    :ok = Hal.Event.attach({test, :refusal}, [:hal, :device, :refusal], tell, nil)
    on_exit(fn -> Hal.Event.detach({test, :refusal}) end)

    pid = device(link)
    Device.look(pid, 0.5, 0.0)
    {_, camera} = play(camera, &match?({:told, 1, "it does not know the command" <> _}, &1))
    refuses? = &match?({:health, :ptz, {{:offline, {:refuses, :look, _}}, _}}, &1)
    {{:health, :ptz, {{:offline, reason}, _}}, camera} = play(camera, refuses?)

    assert Hal.Device.Explanation.offline({Driver, port: link}, reason) ==
             "it refuses every look: it does not know the command (syntax error)"

    {_, camera} = play(put_in(camera.toy.refuse, nil), &match?({:health, :ptz, {:online, _}}, &1))
    {_, camera} = play(camera, pan?(0.5))
    Serial.close(camera.far)
  end

  test "errors are told as what they are" do
    for {reason, words} <- [
          {{:model, 0x0510},
           "expected EVI-D30, EVI-D70 or EVI-D100, got a camera of the unknown model 0x0510"},
          {{:model, nil}, "refuses to say its model"},
          {{:address, 2}, "camera 2 answers, and camera 1 does not"},
          {{:zoom, 0x2000, :d30}, "its zoom is 0x2000, and that of an EVI-D30 ends at 0x03FF"},
          {{:position, 1200, 0, :d30}, "pan 1200, tilt 0, where an EVI-D30 cannot be"},
          {{:opening, :switch_on, "not now"}, "answers, but does not switch on (not now)"},
          {:no_answer, "no camera answers"},
          {:enoent, "/dev/ttyS2: no such device"}
        ],
        line = Driver.explain(reason, port: "/dev/ttyS2") do
      assert line =~ words
      assert String.starts_with?(line, "/dev/ttyS2: ")
    end
  end

  test "the line unplugged, and plugged in again", %{link: link} do
    camera = camera(link)
    pid = device(link)
    Device.look(pid, 0.2, 0.0)
    {_, camera} = play(camera, pan?(0.2))
    Serial.close(camera.far)
    assert_receive {:health, :ptz, {{:offline, _reason}, _}}, 5_000
    {_, camera} = play(camera(link), pan?(0.2))
    Serial.close(camera.far)
  end

  test "a missing line is an error, and wrong options are named", %{link: link} do
    assert Driver.init(port: link) == {:error, :enoent}

    for {wrong, words} <- [
          {[], "visca option port is missing"},
          {[port: 3], ~r/option port: expected .*, got 3/},
          {[port: "a", lens: {1.0, 0.5}], ~r/option lens: expected .*, got \{1\.0, 0\.5\}/},
          {[port: "a", poll_ms: 5],
           "option poll_ms: expected a whole number from 50 to 400 ms, got 5"},
          {[port: "a", speed: -1], ~r/option speed: expected .*, got -1/},
          {[port: "a", serial: [speed: 3]],
           "option serial.speed is not known: allowed are keep_alive_ms, module"},
          {[port: "a", zoom: 3], "option zoom is not known: allowed are port"},
          {:what, ~r/visca options: expected .*, got :what/}
        ] do
      assert {:error, line} = Options.check(wrong)
      assert line =~ words
      refute line =~ "\n"
    end

    assert_raise ArgumentError, ~r/option camera: expected .*, got 9/, fn ->
      Driver.init(port: link, camera: 9)
    end
  end
end
