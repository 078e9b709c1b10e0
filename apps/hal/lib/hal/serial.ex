defmodule Hal.Serial do
  @moduledoc """
  Opens a serial line: raw bytes, 8 data bits, no parity, one stop bit, no flow control. Packet boundaries are left to
  the caller.

      {:ok, line} = Hal.Serial.open(port: "/dev/ttyS0", speed: 115_200, last_words: stop)
      :ok = Hal.Serial.write(line, bytes)

      receive do
        message ->
          case Hal.Serial.handle(line, message) do
            {:data, bytes} -> ...
            {:error, reason} -> ...   # the line cannot be used any more: close it
            :unknown -> ...           # not a message of this line
          end
      end

      :ok = Hal.Serial.close(line)

  A line belongs to the process that opened it, which receives its messages, and it ends with that
  process. The process must trap exits, as `Hal.Device` does, to see the killing of a line as an
  error.

  ## Options

  | option | allowed | default |
  |---|---|---|
  | `:port` | path of a device | this or `:pty` is required |
  | `:pty` | path of a link to create, to the other end of a new pseudo-terminal | |
  | `:speed` | baud, 1 to 20,000,000 | `115_200` |
  | `:last_words` | binary of at most 1024 bytes | `<<>>`: none |
  | `:keep_alive_ms` | 10 to 60,000 | `200` |
  | `:dtr` | whether the line of this name is set: some devices are switched by it; only `Hal.Serial.Native` | `nil`: as the opening leaves it, which is set |
  | `:module` | `Hal.Serial.Native`, or `Hal.Serial.Circuits`: only `:port`, and **no last words** when the VM is killed, frozen or has crashed | `Hal.Serial.Native` |

  ## Last words

  The last words are what the line sends when its owner cannot: a stop. The port program writes
  them when the line is closed, when its process or the whole VM ends in any way, and after
  `:keep_alive_ms` without a sign of life. Signs of life are
  `write/2`, `last_words/2` and `keep_alive/1`. Earlier bytes that would delay them by more than
  20 ms are discarded, so half a packet may precede the last words. `Hal.Serial.Circuits` explains
  what they are worth without the port program.

  Nothing follows the last words. An owner that was silent, because its VM was frozen or had no processor, does not
  know what became of the device meanwhile, so **a line that has said its last words in silence is lost**: what is written
  from then on is discarded, and the owner gets the error `:last_words`, at the latest from the first function that it
  calls. It closes the line, and opens it anew. A line without last words outlives any silence. Nothing that was
  written longer than `:keep_alive_ms` ago is sent by either.

  If only the port program is frozen, nothing can be sent on the line. `keep_alive/1`, called
  often, returns `{:error, :frozen}` after half a second. When the program resumes after more than `keep_alive_ms`, it
  writes the last words, and the line is lost.

  ## Overload

  At most 4096 bytes that the line has not taken are kept. A write that does not fit is rejected
  with `{:error, :overrun}`: a late command is worthless, and no caller waits. The line remains
  usable. An owner that does not take incoming bytes delays the line, which then loses bytes like
  any serial line; no buffer grows (with `Hal.Serial.Circuits` the mailbox does). Taking a message
  means passing it to `handle/2`.

  ## A pseudo-terminal

  With `:pty`, any program may open the link, which is the other end, and close it again; what is
  written meanwhile is lost. The link is removed at the end. It replaces a link that leads
  nowhere, and nothing else.
  """
  alias Hal.{Options, Serial}
  alias Hal.Serial.Line

  @most_words 1024
  @table [
    port: :path,
    pty: :path,
    speed: [{:integer, 1, 20_000_000, "baud"}, default: 115_200],
    last_words: [
      {:check, &__MODULE__.words?/1, "a binary of at most #{@most_words} bytes"},
      default: <<>>
    ],
    keep_alive_ms: [{:integer, 10, 60_000, "ms"}, default: 200],
    dtr: [:boolean, default: nil],
    module: [
      {:check, &__MODULE__.line?/1,
       "Hal.Serial.Native, or Hal.Serial.Circuits where circuits_uart is (MIX_TARGET),"},
      default: Serial.Native
    ]
  ]

  @enforce_keys [:module, :line, :name]
  defstruct @enforce_keys

  @type t :: %__MODULE__{module: module(), line: Line.t(), name: String.t()}
  @type reason :: Line.reason()

  @doc """
  Opens a line; its messages go to the calling process. Wrong options raise `ArgumentError`;
  `options/1` checks them beforehand. For the errors see `explain/2`.
  """
  @spec open(keyword()) :: {:ok, t()} | {:error, reason()}
  def open(options) do
    case options(options) do
      {:ok, options} ->
        with {:ok, line} <- options[:module].open(options) do
          name = options[:port] || options[:pty]
          {:ok, %__MODULE__{module: options[:module], line: line, name: name}}
        end

      {:error, line} ->
        raise ArgumentError, line
    end
  end

  @doc """
  Writes bytes, without waiting. `{:error, :overrun}`: nothing was written, because the line is
  behind.
  """
  @spec write(t(), iodata()) :: :ok | {:error, reason()}
  def write(%__MODULE__{} = t, bytes), do: t.module.write(t.line, bytes)

  @doc """
  Changes the last words; `<<>>` for none. `{:error, :einval}`: they are longer than 1024 bytes.
  """
  @spec last_words(t(), binary()) :: :ok | {:error, reason()}
  def last_words(%__MODULE__{} = t, words) when byte_size(words) <= @most_words,
    do: t.module.last_words(t.line, words)

  def last_words(%__MODULE__{}, words) when is_binary(words), do: {:error, :einval}

  @doc """
  Gives a sign of life when there is nothing to write. `{:error, :frozen}`: the port program has
  not reacted for 500 ms; the line should be closed.
  """
  @spec keep_alive(t()) :: :ok | {:error, reason()}
  def keep_alive(%__MODULE__{} = t), do: t.module.keep_alive(t.line)

  @doc """
  Writes what still waits and the last words, waits until they are out, about a second at most,
  and closes. Messages of the line that were not taken are discarded. A line that is closed or
  lost may be closed again.
  """
  @spec close(t()) :: :ok
  def close(%__MODULE__{} = t), do: t.module.close(t.line)

  @doc """
  Interprets a message of the mailbox. After an error the line cannot be used any more, and should
  be closed.
  """
  @spec handle(t(), message :: term()) :: {:data, binary()} | {:error, reason()} | :unknown
  def handle(%__MODULE__{} = t, message), do: t.module.handle(t.line, message)

  @doc """
  Checks the options and adds the defaults; the error is one line that says what is wrong.

      iex> Hal.Serial.options(port: "/dev/ttyS0", speed: 0)
      {:error, "serial option speed: expected a whole number from 1 to 20000000 baud, got 0"}
  """
  @spec options(keyword()) :: {:ok, keyword()} | {:error, String.t()}
  def options(options) do
    with {:ok, options} <- Options.check(options, @table, "serial"), do: ends(options)
  end

  defp ends(options) do
    case {options[:port], options[:pty], options[:module]} do
      {nil, nil, _} -> {:error, "serial option port is missing: expected the path of a device"}
      {_, nil, _} -> {:ok, options}
      {nil, _, Serial.Native} -> {:ok, options}
      {nil, _, module} -> refuse(:module, module, "Hal.Serial.Native where there is a pty")
      {_, pty, _} -> refuse(:pty, pty, "either port or pty")
    end
  end

  defp refuse(key, value, allowed), do: Options.refuse("serial", [key], value, allowed)

  @doc "The table of the options."
  @spec table() :: Options.table()
  def table, do: @table

  @doc false
  def words?(words), do: is_binary(words) and byte_size(words) <= @most_words

  @doc false
  def line?(module),
    do: is_atom(module) and Code.ensure_loaded?(module) and function_exported?(module, :open, 1)

  @doc """
  Describes an error in one line for people.

      iex> Hal.Serial.explain(:enoent, "/dev/ttyR0")
      "/dev/ttyR0: no such device"
  """
  @spec explain(reason(), port :: String.t()) :: String.t()
  def explain(reason, port), do: "#{port}: #{words(reason)}"

  defp words(:enoent), do: "no such device"

  defp words(:eacces),
    do:
      "permission denied (serial devices are for the group dialout: adduser USER dialout, and log in again)"

  defp words(:ebusy), do: "another program uses it"
  defp words(:eio), do: "there is no hardware behind it"
  defp words(reason) when reason in [:enodev, :enxio], do: "there is no device behind it"
  defp words(:enotty), do: "not a serial device"
  defp words(:einval), do: "the device refuses the settings"
  defp words(:eexist), do: "there is something of this name, which is not replaced"
  defp words(:speed), do: "the device cannot do this speed"
  defp words(:unplugged), do: "unplugged"
  defp words(:terminated), do: "the port program was told to end"
  defp words(:overrun), do: "the line cannot take so much at once"
  defp words(:frozen), do: "its port program is frozen, so nothing can be said on the line"

  defp words(:last_words),
    do:
      "the robot's program, or the one for this line, was frozen; the last words, a stop, were said"

  defp words(:clock), do: "this VM does not read the machine's monotonic clock"
  defp words(:closed), do: "closed"
  defp words(:timeout), do: "no answer"
  defp words({:os, words}), do: words
  defp words({:exit, status}), do: "the port program ended (#{inspect(status)})"
  defp words(other), do: inspect(other)
end
