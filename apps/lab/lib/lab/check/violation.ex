defmodule Lab.Check.Violation do
  @moduledoc "Describes what was wrong in a run: which invariant, when, with which robots, and the figures in one line."

  @enforce_keys [:invariant, :at_ms, :robots, :figures]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          invariant: atom(),
          at_ms: non_neg_integer(),
          robots: [atom()],
          figures: String.t()
        }

  @doc """
  A violation as one line.

      iex> violation = Lab.Check.Violation.new(:collision, 12_300, [:mag1, :mag2], "at 0.31 m/s")
      iex> Lab.Check.Violation.line(violation)
      "collision at 12.3 s, mag1 mag2: at 0.31 m/s"
  """
  @spec line(t()) :: String.t()
  def line(%__MODULE__{} = violation) do
    robots = if violation.robots == [], do: "the run", else: Enum.join(violation.robots, " ")

    "#{violation.invariant} at #{decimals(violation.at_ms / 1000, 1)} s, " <>
      "#{robots}: #{violation.figures}"
  end

  @doc "A violation; the robots are sorted."
  @spec new(atom(), non_neg_integer(), [atom()], String.t()) :: t()
  def new(invariant, at_ms, robots, figures),
    do: %__MODULE__{
      invariant: invariant,
      at_ms: at_ms,
      robots: Enum.sort(robots),
      figures: figures
    }

  @doc """
  The violation of a run that raised at this time; `reason` is that with which its process ends.

      iex> Lab.Check.Violation.crash(3_100, {:badarith, [{:erlang, :/, [1, 0], []}]}).figures
      ":badarith in :erlang.//2"
  """
  @spec crash(non_neg_integer(), reason :: term()) :: t()
  def crash(at_ms, reason), do: new(:crash, at_ms, [], ended(reason))

  defp ended({reason, [{module, function, arity, _place} | _stack]}) do
    arity = if is_list(arity), do: length(arity), else: arity
    "#{inspect(reason, limit: 8)} in #{inspect(module)}.#{function}/#{arity}"
  end

  defp ended(reason), do: "exit #{inspect(reason, limit: 8)}"

  @doc "A figure with so many decimals."
  @spec decimals(number(), 0..15) :: String.t()
  def decimals(number, count), do: :erlang.float_to_binary(number * 1.0, decimals: count)
end
