defmodule Sim.WheelsModel do
  @moduledoc """
  When the wheels of a robot may turn: while they are armed, an order runs, and no emergency stop holds it. Pure; what
  people ask and what breaks are steps. What is not certain, as an order that was not answered, may be so.
  """

  @enforce_keys [:arm]
  defstruct @enforce_keys ++ [armed?: false, order?: false, held?: false]

  @type t :: %__MODULE__{
          arm: :manual | :auto,
          armed?: boolean(),
          order?: boolean(),
          held?: boolean()
        }
  @type person :: :arm | :acknowledge | :drive | :stop | :estop | :reset | :disarm
  @type fault ::
          {:freeze | :freeze_program | :cut, ms :: pos_integer()} | :kill_drive

  @doc "A robot that has just been started."
  @spec new(:manual | :auto) :: t()
  def new(arm), do: %__MODULE__{arm: arm, armed?: arm == :auto}

  @doc "Whether its wheels may turn."
  @spec may_turn?(t()) :: boolean()
  def may_turn?(model), do: model.armed? and model.order? and not model.held?

  @doc "What a person asked, with the answer to that; what broke, with anything."
  @spec step(t(), person() | fault(), :ok | {:error, String.t()} | term()) :: t()
  def step(model, :arm, :ok), do: %{model | armed?: true}
  def step(model, :drive, :ok), do: %{model | order?: true}

  def step(model, :drive, {:error, line}),
    do: if(line =~ "does not answer", do: %{model | order?: true}, else: model)

  def step(model, :stop, :ok), do: %{model | order?: false}
  def step(model, :estop, :ok), do: %{model | order?: false, held?: true}
  def step(model, :reset, _done_or_not), do: %{model | held?: false}
  def step(model, :disarm, :ok), do: %{model | order?: false, armed?: false}
  def step(model, person, _answer) when is_atom(person) and person != :kill_drive, do: model

  # The last words were said: a person arms again, unless the drive does so by itself.
  def step(model, _fault, _nothing),
    do: %{model | order?: false, armed?: model.armed? and model.arm == :auto}

  @doc """
  So many steps, drawn at random; in two of three cases what stops a robot is followed by what a person does to drive it
  again. Freezes are longer than the 0.2 s that the port program waits.
  """
  @spec draw(pos_integer(), :rand.state()) :: {[person() | fault()], :rand.state()}
  def draw(count, rand) do
    {first, rand} = again(rand)
    {steps, rand} = Enum.flat_map_reduce(1..count, rand, fn _n, rand -> one(rand) end)
    {first ++ steps, rand}
  end

  @weights [
    drive: 4,
    arm: 2,
    acknowledge: 2,
    stop: 2,
    estop: 1,
    reset: 2,
    disarm: 1,
    freeze: 6,
    freeze_program: 1,
    cut: 1,
    kill_drive: 1
  ]
  @drawn Enum.flat_map(@weights, fn {step, weight} -> List.duplicate(step, weight) end)

  defp one(rand) do
    {n, rand} = :rand.uniform_s(length(@drawn), rand)
    {part, rand} = :rand.uniform_s(rand)

    case Enum.at(@drawn, n - 1) do
      :freeze ->
        stopped({:freeze, 205 + round(3_795 * part * part * part)}, rand)

      fault when fault in [:freeze_program, :cut] ->
        stopped({fault, 205 + round(600 * part)}, rand)

      step when step in [:drive, :arm, :acknowledge, :reset] ->
        {[step], rand}

      step ->
        stopped(step, rand)
    end
  end

  defp stopped(step, rand) do
    {again, rand} = again(rand)
    {[step | again], rand}
  end

  defp again(rand) do
    {n, rand} = :rand.uniform_s(3, rand)
    {if(n == 3, do: [], else: [:reset, :acknowledge, :arm, :drive]), rand}
  end
end
