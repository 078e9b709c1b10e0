defmodule Hal.RFlex.PowerSwitch do
  @moduledoc """
  The shut-down of the whole robot: the controller listens on the computer's serial console, and cuts the
  power once it reads there that the system has halted. An operating system that says it in other words
  leaves the power on, so the phrase is configurable and is said by us, as the last thing.

  | option | allowed | default |
  |---|---|---|
  | `:port` | the console's device | must be given |
  | `:speed` | baud | `9600` |
  | `:phrase` | 1 to 80 printable ASCII characters | `"The system is halted"` |
  | `:serial` | further options for `Hal.Serial` | `[]` |

  The command is `robot halt` (`Swarm.Host.PowerOff`), off unless the robot's file has a `console:`.
  Whoever calls this is about to lose power: file systems are to be unmounted or read-only.
  """
  alias Hal.Serial

  @keys [:port, :phrase, speed: 9600, serial: []]
  @phrase "The system is halted"

  @doc """
  The bytes of a phrase: on a line of its own.

      iex> Hal.RFlex.PowerSwitch.bytes("System halted")
      "\\r\\nSystem halted\\r\\n"
  """
  @spec bytes(String.t()) :: binary()
  def bytes(phrase), do: "\r\n" <> phrase <> "\r\n"

  @doc "Says it. Errors are one line."
  @spec halt(keyword()) :: :ok | {:error, String.t()}
  def halt(options) do
    with {:ok, options} <- options(options) do
      words = bytes(options[:phrase])
      serial = [port: options[:port], speed: options[:speed], last_words: words]

      # As last words they are on the line before closing comes back, whatever else waits.
      case Serial.open(serial ++ options[:serial]) do
        {:ok, line} -> Serial.close(line)
        {:error, reason} -> {:error, Serial.explain(reason, options[:port])}
      end
    end
  end

  @doc """
  Checks options and fills in what is missing.

      iex> Hal.RFlex.PowerSwitch.options(port: "/dev/ttyS0", phrase: "")
      {:error, "console option :phrase cannot be \\"\\": it must be 1 to 80 printable ASCII characters"}
  """
  @spec options(keyword()) :: {:ok, keyword()} | {:error, String.t()}
  def options(options) do
    with {:ok, options} <- known(options),
         options = Keyword.put_new(options, :phrase, @phrase),
         :ok <- phrase(options[:phrase]),
         serial = [port: options[:port], speed: options[:speed]],
         {:ok, _} <- Serial.options(serial ++ options[:serial]),
         do: {:ok, options}
  end

  defp known(options) do
    case Keyword.validate(options, @keys) do
      {:ok, options} -> {:ok, options}
      {:error, [key | _]} -> {:error, "there is no console option #{inspect(key)}"}
    end
  end

  defp phrase(phrase) do
    if is_binary(phrase) and byte_size(phrase) in 1..80 and
         Enum.all?(:binary.bin_to_list(phrase), &(&1 in 0x20..0x7E)),
       do: :ok,
       else:
         {:error,
          "console option :phrase cannot be #{inspect(phrase, printable_limit: 60)}: " <>
            "it must be 1 to 80 printable ASCII characters"}
  end
end
