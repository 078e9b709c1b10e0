defmodule Console do
  @moduledoc """
  Describes what people see and type: the demo and its terminal, the page in the browser, reports, pictures, scenarios, replays.

  A view knows a fleet only by `Console.Live`: it asks for the scene, and passes on commands that
  `Console.Prompt` has checked. No robot knows a view, and no view decides anything.

      iex> Console.Prompt.parse("goto mag1 1,2", [:mag1])
      {:ok, {:tell, [:mag1], {:goto, 1.0, 2.0, nil}}}
      iex> Console.Prompt.parse("fromation wedge", [:mag1])
      {:error, ~s(unknown command "fromation"; did you mean formation?)}

  A live run:

      Console.Terminal.Session   keys, lines, the time to draw
      |-- Console.Live.*         the fleet: of this node, of other nodes, in lockstep, of a mesh
      `-- Console.Page           the page: a feed of scenes, mochiweb, a process for each browser

  Go on with `Console.Live`, then `docs/user-guide.md`. `Console.Cli` has what all command lines share.
  """
end
