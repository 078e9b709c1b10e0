defmodule Hal.RFlex.PowerSwitch do
  @moduledoc """
  Switches the power of the whole robot off: the controller listens on the computer's serial
  console, and cuts the power once it reads there that the system has halted. An operating system
  that uses other words leaves the power on, so Convoy prints a configurable phrase as its last
  output.

  | option | allowed | default |
  |---|---|---|
  | `:port` | the console's device | required |
  | `:speed` | baud | `9600` |
  | `:phrase` | 1 to 80 printable ASCII characters | `"The system is halted"` |
  | `:serial` | further options for `Hal.Serial` | `[]` |

  The command is `robot halt` (`Swarm.Host.PowerOff`), which is off unless the robot's file has a
  `console:`. The caller is about to lose power: it should have unmounted the file systems, or
  made them read-only.
  """
  alias Hal.{Options, Serial}

  @table [
    port: [:path, required: true],
    speed: [{:integer, 1, 20_000_000, "baud"}, default: 9_600],
    phrase: [
      {:check, &__MODULE__.phrase?/1, "text of 1 to 80 printable ASCII characters"},
      default: "The system is halted"
    ],
    serial: [
      {:keys, Keyword.take(Serial.table(), [:module, :keep_alive_ms])},
      default: []
    ]
  ]

  @doc """
  The bytes that print a phrase on a line of its own.

      iex> Hal.RFlex.PowerSwitch.bytes("System halted")
      "\\r\\nSystem halted\\r\\n"
  """
  @spec bytes(String.t()) :: binary()
  def bytes(phrase), do: "\r\n" <> phrase <> "\r\n"

  @doc "Prints the phrase. The error is one line for people."
  @spec halt(keyword()) :: :ok | {:error, String.t()}
  def halt(options) do
    with {:ok, options} <- options(options) do
      words = bytes(options[:phrase])
      serial = [port: options[:port], speed: options[:speed], last_words: words]

      # As last words they are written before `close/1` returns, whatever else waits.
      case Serial.open(serial ++ options[:serial]) do
        {:ok, line} -> Serial.close(line)
        {:error, reason} -> {:error, Serial.explain(reason, options[:port])}
      end
    end
  end

  @doc """
  Checks the options and adds the defaults.

      iex> Hal.RFlex.PowerSwitch.options(port: "/dev/ttyS0", phrase: "")
      {:error, "console option phrase: expected text of 1 to 80 printable ASCII characters, got \\"\\""}
  """
  @spec options(keyword()) :: {:ok, keyword()} | {:error, String.t()}
  def options(options), do: Options.check(options, @table, "console")

  @doc "The table of the options."
  @spec table() :: Options.table()
  def table, do: @table

  @doc false
  def phrase?(phrase),
    do: is_binary(phrase) and byte_size(phrase) in 1..80 and phrase =~ ~r/\A[ -~]+\z/
end
