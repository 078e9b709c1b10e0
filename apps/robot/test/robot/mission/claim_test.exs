defmodule Robot.Mission.ClaimTest do
  use ExUnit.Case, async: true
  alias Robot.Mission
  alias Robot.Mission.Claim

  doctest Claim

  defmodule Bare do
    defstruct near: 0
  end

  defmodule Whole do
    defstruct near: 0
    def valid?(%{near: near}), do: near in 0..9
  end

  for {name, said} <- [Checked: {3, Whole}, Unchecked: {3, Bare}, NoStruct: {3, Enum}, Odd: Whole] do
    defmodule Module.concat(__MODULE__, name) do
      def claims, do: unquote(Macro.escape(said))
    end
  end

  test "a mission whose claims others could not check does not start" do
    assert Mission.check_options(__MODULE__.Checked, [], nil) == {:ok, []}

    for {mission, line} <- [
          {__MODULE__.Unchecked,
           "unchecked claims Robot.Mission.ClaimTest.Bare, which lacks valid?/1: whether one from outside makes sense"},
          {__MODULE__.NoStruct, "no_struct claims Enum, which is no struct of this build"},
          {__MODULE__.Odd,
           "odd claims/0: expected {version, module of a struct}, got Robot.Mission.ClaimTest.Whole"}
        ],
        do: assert(Mission.check_options(mission, [], nil) == {:error, line})
  end

  test "one from outside is heard if its own struct allows it" do
    claim = Claim.new(__MODULE__.Checked, %{near: 3, phase: :drive})
    assert claim.fields == %Whole{near: 3}
    assert Claim.check(claim) == {:ok, claim}

    for odd <- [
          put_in(claim.fields.near, 10),
          %{claim | fields: %{near: 3}},
          %{claim | fields: Map.delete(claim.fields, :near)}
        ],
        do: assert(Claim.check(odd) == :error)

    assert Claim.check(%{claim | version: 4}) == {:ok, nil}
  end
end
