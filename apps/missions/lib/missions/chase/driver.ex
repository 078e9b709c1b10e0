defmodule Missions.Chase.Driver do
  @moduledoc """
  Decides which robot drives the ball: exactly one, without a server. Pure.

  Each robot tells five times a second what it would cost it to drive, and whether it does. Where none is heard to drive for 0.6 s, the
  one of the least cost does, of equal ones the first by name. It goes on until another would do it for less by a metre during a
  second; then it leaves it to that one, and does not take it for 3 s. Of two that drive, which a lost message
  may cause, the first by name goes on. One that has been silent for 1.2 s counts for nothing. A driver keeps off the ball in its
  first second, by which any other has heard of it.
  """

  @fresh_ms 1_200
  @quiet_ms 600
  @better_m 1.0
  @worse_ms 1_000
  @leaves_ms 3_000
  @sure_ms 1_000

  defstruct since_ms: nil, quiet_ms: nil, worse_ms: nil, left_ms: nil

  @typedoc "`since_ms` is since when this robot drives, `nil` if it does not."
  @type t :: %__MODULE__{
          since_ms: integer() | nil,
          quiet_ms: integer() | nil,
          worse_ms: integer() | nil,
          left_ms: integer() | nil
        }

  @typedoc "What another robot told: its cost in metres, `nil` if it cannot drive, and whether it drives."
  @type peer :: %{
          required(:at_ms) => integer(),
          required(:cost) => float() | nil,
          required(:drives?) => boolean(),
          optional(atom()) => term()
        }

  @doc """
  One tick of robot `me`, whose cost is in metres, `nil` if it cannot drive.

      iex> tick = fn driver, at_ms, heard -> Missions.Chase.Driver.tick(driver, :b, 2.0, heard, at_ms) end
      iex> heard = %{a: %{at_ms: 0, cost: 2.5, drives?: false}}
      iex> driver = %Missions.Chase.Driver{} |> tick.(0, heard) |> tick.(700, heard)
      iex> Missions.Chase.Driver.drives?(driver)
      true
      iex> driver |> tick.(800, %{a: %{at_ms: 800, cost: 2.5, drives?: true}}) |> Missions.Chase.Driver.drives?()
      false
  """
  @spec tick(t(), atom(), float() | nil, %{atom() => peer()}, integer()) :: t()
  def tick(driver, me, cost, heard, now_ms) do
    heard = for {id, peer} <- heard, now_ms - peer.at_ms <= @fresh_ms, do: {id, peer}
    drivers = for {id, %{drives?: true}} <- heard, do: id
    costs = for {id, %{cost: cost}} when cost != nil <- heard, do: {cost, id}
    step(driver, me, cost, drivers, costs, now_ms)
  end

  defp step(%{since_ms: nil} = driver, me, cost, drivers, costs, now_ms) do
    quiet_ms = if drivers == [], do: driver.quiet_ms || now_ms
    left? = driver.left_ms != nil and now_ms - driver.left_ms < @leaves_ms and costs != []
    driver = %{driver | quiet_ms: quiet_ms}

    if cost != nil and not left? and quiet_ms != nil and now_ms - quiet_ms >= @quiet_ms and
         Enum.all?(costs, &({cost, me} < &1)),
       do: %__MODULE__{since_ms: now_ms},
       else: driver
  end

  defp step(driver, me, cost, drivers, costs, now_ms) do
    worse_ms = if worse?(cost, costs), do: driver.worse_ms || now_ms

    cond do
      Enum.any?(drivers, &(&1 < me)) -> %__MODULE__{}
      cost == nil -> %__MODULE__{left_ms: now_ms}
      worse_ms != nil and now_ms - worse_ms >= @worse_ms -> %__MODULE__{left_ms: now_ms}
      true -> %{driver | worse_ms: worse_ms}
    end
  end

  defp worse?(nil, _costs), do: true
  defp worse?(cost, costs), do: Enum.any?(costs, fn {other, _id} -> other + @better_m < cost end)

  @doc "Whether this robot drives the ball."
  @spec drives?(t()) :: boolean()
  def drives?(%__MODULE__{since_ms: since_ms}), do: since_ms != nil

  @doc "Whether it may touch the ball."
  @spec sure?(t(), integer()) :: boolean()
  def sure?(%__MODULE__{since_ms: nil}, _now_ms), do: false
  def sure?(%__MODULE__{since_ms: since_ms}, now_ms), do: now_ms - since_ms >= @sure_ms

  @doc "The other robot that drives, as far as it was heard; `nil` for none."
  @spec other(%{atom() => peer()}, integer()) :: atom() | nil
  def other(heard, now_ms) do
    drivers =
      for {id, %{drives?: true, at_ms: at_ms}} <- heard, now_ms - at_ms <= @fresh_ms, do: id

    Enum.min(drivers, fn -> nil end)
  end
end
