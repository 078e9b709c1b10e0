defmodule Hal.Serial.PortTest do
  use ExUnit.Case, async: true
  alias Hal.Serial

  setup do
    Process.flag(:trap_exit, true)

    folder =
      Path.join(System.tmp_dir!(), "serial_#{System.unique_integer([:positive])}_#{System.pid()}")

    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    {:ok, link: Path.join(folder, "line")}
  end

  test "both ways", %{link: link} do
    {:ok, far} = Serial.open(pty: link)
    {:ok, near} = Serial.open(port: link)
    :ok = Serial.write(near, "hello")
    assert read(far, 5) == "hello"
    :ok = Serial.write(far, :binary.list_to_bin(Enum.to_list(0..255)))
    assert read(near, 256) == :binary.list_to_bin(Enum.to_list(0..255))
    :ok = Serial.close(near)
    :ok = Serial.close(far)
    refute File.exists?(link)
    assert {:error, :enoent} = Serial.open(port: link)
  end

  defp read(line, size, had \\ <<>>) do
    if byte_size(had) >= size do
      had
    else
      assert_receive message

      case Serial.handle(line, message) do
        {:data, bytes} -> read(line, size, had <> bytes)
        other -> flunk(inspect(other))
      end
    end
  end
end
