defmodule Hal.RobotName do
  @moduledoc """
  Says what a robot may be called: `[a-z][a-z0-9_]{0,30}`. Pure.

  Names are atoms, and come from the configuration of this machine alone: a robot's file, the list of a fleet, a command
  line. What arrives by radio is compared with them as text (`Mesh`), and no text from outside is ever given to `read/1`.
  """

  @form ~S"[a-z][a-z0-9_]{0,30}"
  @allowed "a name of small letters, digits and _, at most 31, that begins with a letter, such as :mag1"
  # What is known where no fleet is given.
  @usual_kinds ~w(mag min)
  @most 100

  @doc "The form of a name, a regular expression without anchors."
  @spec form() :: String.t()
  def form, do: @form

  @doc "What is allowed, for messages."
  @spec allowed() :: String.t()
  def allowed, do: @allowed

  @doc """
  Whether a text or an atom has the form of a name.

      iex> for name <- ["rover_2", :mag1, "Rover", "2nd", "", nil], do: Hal.RobotName.valid?(name)
      [true, true, false, false, false, false]
  """
  @spec valid?(term()) :: boolean()
  def valid?(nil), do: false
  def valid?(name) when is_atom(name), do: name |> Atom.to_string() |> valid?()
  def valid?(text), do: is_binary(text) and Regex.match?(~r/\A#{@form}\z/, text)

  @doc """
  The name of a text of this machine's configuration: makes an atom if there is none yet.

      iex> {Hal.RobotName.read("rover_2"), Hal.RobotName.read("Rover")}
      {{:ok, :rover_2}, :error}
  """
  @spec read(String.t()) :: {:ok, atom()} | :error
  def read(text), do: if(valid?(text), do: {:ok, String.to_atom(text)}, else: :error)

  @doc """
  The names of so many robots of a kind. A kind that ends in a digit is set off from the numbers.

      iex> {Hal.RobotName.numbered("burger", 2), Hal.RobotName.numbered("create2", 2)}
      {[:burger1, :burger2], [:create2_1, :create2_2]}
  """
  @spec numbered(kind :: String.t(), count :: non_neg_integer()) :: [atom()]
  def numbered(kind, count) do
    gap = if String.last(kind) in ~w(0 1 2 3 4 5 6 7 8 9), do: "_", else: ""
    for n <- 1..count//1, do: String.to_atom("#{kind}#{gap}#{n}")
  end

  @doc """
  The kind that a name has before its number.

      iex> for name <- [:burger12, :create2_1, :rover, :lab_2], do: Hal.RobotName.kind(name)
      ["burger", "create2", "rover", "lab"]
  """
  @spec kind(atom() | String.t()) :: String.t()
  def kind(name), do: name |> to_string() |> String.replace(~r/_?\d+\z/, "")

  @doc "The names that are known where no fleet is given: `mag1` to `mag100` and `min1` to `min100`."
  @spec usual() :: [atom(), ...]
  def usual, do: Enum.flat_map(@usual_kinds, &numbered(&1, @most))
end
