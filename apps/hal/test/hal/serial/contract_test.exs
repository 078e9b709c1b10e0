defmodule Hal.Serial.ContractTest do
  @moduledoc "What holds for every module that carries a serial line; `circuits_uart` where it is."
  use ExUnit.Case, async: true
  import Hal.Lines
  alias Hal.Serial

  @stop "\eSTOP\r"
  @modules [Serial.Native, Serial.Circuits]

  setup do
    Process.flag(:trap_exit, true)
    link = Path.join(folder(), "line")
    far = far!(link)
    {:ok, link: link, far: far}
  end

  defp open(module, link, options \\ []) do
    defaults = [port: link, module: module, last_words: @stop, keep_alive_ms: 60_000]
    {:ok, near} = Serial.open(Keyword.merge(defaults, options))
    near
  end

  # What the line says next to its owner.
  defp said(near) do
    assert_receive message, 5_000
    with :unknown <- Serial.handle(near, message), do: said(near)
  end

  defp hear(_near, 0, had), do: had

  defp hear(near, size, had) do
    assert {:data, bytes} = said(near)
    hear(near, size - byte_size(bytes), had <> bytes)
  end

  for module <- @modules do
    describe "#{inspect(module)}" do
      @describetag carrier: module

      if module == Serial.Circuits do
        @describetag adapter: :circuits_uart
        unless Code.ensure_loaded?(module),
          do: @describetag(skip: "circuits_uart is not installed")
      end

      test "all bytes both ways, then the last words", %{carrier: module, link: link, far: far} do
        near = open(module, link)
        bytes = :binary.list_to_bin(Enum.to_list(0..255))
        assert Serial.write(near, [bytes, ?a]) == :ok
        assert read(far, 257) == bytes <> "a"
        :ok = Serial.write(far, bytes)
        assert hear(near, 256, "") == bytes
        assert Serial.handle(near, :other) == :unknown
        assert Serial.last_words(near, "other") == :ok
        assert Serial.close(near) == :ok
        assert read(far, 5) == "other"
        assert Serial.write(near, "x") == {:error, :closed}
        assert Serial.keep_alive(near) == {:error, :closed}
        assert Serial.close(near) == :ok
      end

      test "errors at opening", %{carrier: module, link: link} do
        assert Serial.open(port: link <> "_none", module: module) == {:error, :enoent}
        near = open(module, link)
        assert Serial.open(port: link, module: module) == {:error, :ebusy}
        :ok = Serial.close(near)
        assert {:ok, _} = Serial.open(port: link, module: module)
      end

      test "at most 4 kB under way", %{carrier: module, link: link} do
        near = open(module, link)
        assert Serial.write(near, :binary.copy("x", 4097)) == {:error, :overrun}
      end

      test "last words when the owner ends", %{carrier: module, link: link, far: far} do
        spawn(fn -> open(module, link) end)
        assert read(far, 6) == @stop
        me = self()

        pid =
          spawn(fn ->
            open(module, link)
            send(me, :open)
            receive(do: (:never -> :ok))
          end)

        assert_receive :open
        Process.exit(pid, :kill)
        assert read(far, 6) == @stop
      end

      test "last words in silence, and nothing after them", %{
        carrier: module,
        link: link,
        far: far
      } do
        near = open(module, link, keep_alive_ms: 50)
        assert read(far, 6) == @stop
        assert said(near) == {:error, :last_words}
        _discarded_or_refused = Serial.write(near, "going\r")
        _discarded_or_refused = Serial.keep_alive(near)
        :ok = Serial.close(near)
        again = open(module, link)
        :ok = Serial.write(again, "again\r")
        refute read_until(far, "again\r") =~ "going"
      end

      test "unplugged", %{carrier: module, link: link, far: far} do
        near = open(module, link)
        :ok = Serial.write(near, "go")
        assert read(far, 2) == "go"
        :ok = Serial.close(far)
        assert said(near) == {:error, :unplugged}
        assert Serial.close(near) == :ok
      end
    end
  end
end
